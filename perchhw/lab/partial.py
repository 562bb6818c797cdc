"""The addresses that a look at the lab needs: what was given, else the lab file's, and not all of them."""

from dataclasses import dataclass
from pathlib import Path

from mocap_bridge.uri import parse_mocap_uri
from onboard.lab_file import LabFile
from onboard.link.uri import check_drone_uri
from perchhw.attempt import DEFAULT_VEHICLE
from perchhw.lab.find import find_lab
from perchhw.lab.setup import SetupError, flight_setup


@dataclass(frozen=True)
class Addresses:
    """What is there; None for what was neither given nor is in the lab file."""

    drone: str | None
    mocap: str | None
    vehicle: str
    lab: LabFile | None


def addresses(lab: Path | None, drone: str | None, mocap: str | None, vehicle: str | None) -> Addresses:
    """Complete what was given (None: it was not) from the lab file that counts.

    Raises:
        SetupError: nothing is named, or the lab file has several drones. InputError: an address or a lab
            file that cannot be used.
    """
    found = find_lab(lab)
    if found is not None:
        setup = flight_setup(found, drone=drone, mocap=mocap, vehicle=vehicle)
        drone, mocap, vehicle = setup.drone, setup.mocap, setup.vehicle
    if drone is None and mocap is None:
        raise SetupError("drone", "missing; give it, or --mocap URI, or a lab file: --lab FILE")
    if drone is not None:
        check_drone_uri(drone)
    if mocap is not None:
        parse_mocap_uri(mocap)
    return Addresses(drone, mocap, vehicle or DEFAULT_VEHICLE, found)


def poses_of(lab: Path | None, drone: str | None) -> str:
    """Where the poses of `drone` (None: of the only one) come from, by the lab file that counts.

    Raises:
        SetupError: there is no lab file, or it has several drones. InputError: a lab file that cannot
            be used.
    """
    found = find_lab(lab)
    if found is None:
        raise SetupError(
            "lab",
            "missing; give it, or what to watch instead: vicon://HOST[:PORT]?subject=NAME, or another URI",
        )
    return flight_setup(found, drone=drone).mocap
