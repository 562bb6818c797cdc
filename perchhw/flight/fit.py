"""Policy, vehicle, legs, room and drone belong together, or nobody flies by accident.

The height of the ceiling in training is no matter: cues and placement count from the ceiling down. What
matters is that the drone is told the height of the ceiling that is there.
"""

from dataclasses import dataclass
from typing import TYPE_CHECKING

from onboard.errors import InputError
from onboard.firmware.constants import vehicle_crc32
from onboard.lab_file.bounds import CEILING_HEIGHT
from onboard.link.errors import NoSuchVariable
from onboard.link.landing_app import other_vehicle
from onboard.policy.files import find_policy, load_policy
from onboard.policy.model import Policy
from onboard.room import RoomGeometry
from onboard.vehicle import Vehicle, load_vehicle
from perchhw.attempt import AttemptRequest
from perchhw.errors import FlightStackError
from perchhw.trained_for import trained_for_of

if TYPE_CHECKING:
    from onboard.link import DroneLink

ACCEPT = "--accept-mismatch"


class Mismatch(FlightStackError, InputError):
    """What was asked for does not belong together; one line each."""


@dataclass
class Fit:
    """How what was asked for goes together; all of that is known only once the drone was asked.

    Attributes:
        mismatches: what does not, one sentence each, with both sides and what to do.
        unknown: what could not be compared, one sentence each.
    """

    mismatches: tuple[str, ...]
    unknown: tuple[str, ...]

    def require(self, accepted: bool) -> None:
        """Refuse what does not belong together, unless that is `accepted`.

        Raises:
            Mismatch: with all of it.
        """
        if self.mismatches and not accepted:
            raise Mismatch("\n".join((*self.mismatches, f"or fly it all the same: {ACCEPT}")))

    def ask_drone(self, link: "DroneLink", vehicle: Vehicle, accepted: bool) -> str | None:
        """Hold the drone's firmware against `vehicle` too; why it must not be armed, or None.

        Raises:
            LinkTimeout, LinkLost: the link failed.
        """
        try:
            other = other_vehicle(link, vehicle_crc32(vehicle), vehicle.name)
        except NoSuchVariable as error:
            other = str(error)
        if other is None:
            return None
        if accepted:
            self.mismatches = (*self.mismatches, other)
            return None
        return f"{other}, or fly it all the same: {ACCEPT}"


def check_fit(request: AttemptRequest) -> None:
    """Refuse what of `request` does not belong together, unless it accepts that; nothing is connected.

    Raises:
        Mismatch: with all of it. InputError: policy or vehicle cannot be used.
    """
    policy = load_policy(find_policy(request.policy))
    fit_of(request, policy, load_vehicle(request.vehicle, request.legs)).require(request.accept_mismatch)


def fit_of(request: AttemptRequest, policy: Policy, vehicle: Vehicle) -> Fit:
    """How the policy, the vehicle with its legs and the room of `request` go together."""
    trained = trained_for_of(policy)
    ceiling = _other_ceiling(request)
    if trained is not None:
        return Fit((*trained.other_than(policy.name, vehicle), *ceiling), ())
    bare = () if vehicle.legs is not None else (_no_legs(vehicle),)
    silent = (
        f"policy {policy.name!r} does not say what vehicle and legs it was trained for: nobody has compared "
        "them with this one"
    )
    return Fit((*bare, *ceiling), (silent,))


def _no_legs(vehicle: Vehicle) -> str:
    return f"{vehicle.name} has no legs, and nothing else holds on to a ceiling: give its legs (--legs NAME)"


def _other_ceiling(request: AttemptRequest) -> tuple[str, ...]:
    """The height that the drone would be told, against that of the room that it flies in."""
    lab = request.lab
    told = request.room.ceiling_z
    there = (RoomGeometry() if lab is None else lab.room.geometry()).ceiling_z
    if abs(told - there) <= CEILING_HEIGHT.sigma:
        return ()
    where = "the simulated room's" if lab is None else f"the one in {lab.file}"
    mend = "" if lab is None else f", or measure it again and mend {lab.file}"
    return (
        f"the flight is asked for under a ceiling at {told:g} m, and {where} is at {there:g} m: "
        f"leave the height away{mend}",
    )
