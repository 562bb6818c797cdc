"""Who flies, where and with what: each from its option (or campaign file), else from the lab file."""

from dataclasses import dataclass, replace
from pathlib import Path

from mocap_bridge.uri import parse_mocap_uri
from onboard.errors import InputError
from onboard.lab_file import CEILING_HEIGHT, LabDrone, LabFile, SubjectToBody, plain, split_subject
from onboard.link.uri import check_drone_uri
from onboard.record.folder import new_run_folder
from onboard.room import RoomGeometry
from perchhw.attempt import DEFAULT_POLICY, DEFAULT_VEHICLE, AttemptRequest
from perchhw.errors import FlightStackError
from perchhw.lab.hardware import require_lab

_MISSING = "missing; give it, or a lab file that has it: --lab FILE, or lab.toml in this folder"


class SetupError(FlightStackError, InputError):
    """Something is neither given nor in the lab file, or is given and cannot be used.

    Attributes:
        key: what: ``drone``, ``mocap``, ``vehicle`` or ``ceiling``.
    """

    def __init__(self, key: str, message: str) -> None:
        super().__init__(f"--{key}: {message}")
        self.key = key
        self.message = message


@dataclass(frozen=True, kw_only=True)
class DeskSetup:
    """What drone it is, and the room of its approaches; see :class:`perchhw.attempt.AttemptRequest`."""

    drone: str
    vehicle: str
    legs: str | None
    policy: str
    room: RoomGeometry


@dataclass(frozen=True, kw_only=True)
class FlightSetup:
    """What flies where; see :class:`perchhw.attempt.AttemptRequest`."""

    drone: str
    mocap: str
    vehicle: str
    legs: str | None
    policy: str
    room: RoomGeometry
    lab: LabFile | None

    def check(self) -> None:
        """Refuse addresses that cannot be used, and hardware without a lab file; connects to nothing.

        Raises:
            InputError: the message says what to do.
        """
        check_drone_uri(self.drone)
        parse_mocap_uri(self.mocap)
        require_lab(self.drone, self.mocap, self.lab)

    def attempt(self, speed: float, angle_deg: float, out: Path) -> AttemptRequest:
        """One attempt at `speed` (m/s) and `angle_deg`, with a new folder in `out` for its record.

        Raises:
            OutputFolderError: `out` cannot be written.
        """
        return AttemptRequest(
            speed=speed,
            angle_deg=angle_deg,
            index=0,
            folder=new_run_folder(out, f"fly-{speed:g}ms-{angle_deg:g}deg"),
            drone=self.drone,
            mocap=self.mocap,
            policy=self.policy,
            vehicle=self.vehicle,
            legs=self.legs,
            room=self.room,
            lab=self.lab,
        )


def flight_setup(
    lab: LabFile | None,
    *,
    drone: str | None = None,
    mocap: str | None = None,
    vehicle: str | None = None,
    legs: str | None = None,
    policy: str | None = None,
    ceiling: float | None = None,
) -> FlightSetup:
    """Complete what was given (None: it was not) from the lab file and the defaults.

    Vehicle, legs and policy come from the file's drone with that very address. Without a lab file the room
    is the simulated one.

    Raises:
        SetupError: nothing says which drone, which motion capture or which vehicle, what was given is empty,
            the file's ``subject_to_body`` is of another subject, or `ceiling` is no height of a ceiling.
    """
    _refuse_empty(drone=drone, mocap=mocap)
    drone = drone or _only_drone(lab)
    known = None if lab is None else lab.drone(drone)
    mocap = mocap or _mocap(lab, known)
    if lab is not None:
        _check_subject(lab, known, mocap)
    desk = desk_setup(lab, drone=drone, vehicle=vehicle, legs=legs, policy=policy)
    return FlightSetup(
        drone=drone,
        mocap=mocap,
        vehicle=desk.vehicle,
        legs=desk.legs,
        policy=desk.policy,
        room=desk.room if ceiling is None else _under(desk.room, ceiling),
        lab=lab,
    )


def desk_setup(
    lab: LabFile | None,
    *,
    drone: str | None = None,
    vehicle: str | None = None,
    legs: str | None = None,
    policy: str | None = None,
) -> DeskSetup:
    """As :func:`flight_setup`, for who needs no poses.

    Raises:
        SetupError: nothing says which drone or which vehicle, or what was given is empty.
    """
    _refuse_empty(drone=drone, vehicle=vehicle, legs=legs, policy=policy)
    drone = drone or _only_drone(lab)
    known = None if lab is None else lab.drone(drone)
    if lab is not None and known is None and vehicle is None:
        has = ", ".join(one.uri for one in lab.drones)
        raise SetupError(
            "vehicle",
            f"{lab.file} has no drone {drone}, it has {has}; give one of these as it stands there, "
            "add this one under [[drones]], or give its vehicle too",
        )
    if lab is not None and known is not None:
        vehicle = vehicle or lab.beside(known.vehicle)
        legs = legs or known.legs
        policy = policy or (None if known.policy is None else lab.beside(known.policy))
    return DeskSetup(
        drone=drone,
        vehicle=vehicle or DEFAULT_VEHICLE,
        legs=legs,
        policy=policy or DEFAULT_POLICY,
        room=RoomGeometry() if lab is None else lab.room.geometry(),
    )


def _under(room: RoomGeometry, ceiling: float) -> RoomGeometry:
    """The room under a ceiling at another height."""
    problem = CEILING_HEIGHT.problem(ceiling, plain(ceiling, "m"))
    if problem is not None:
        raise SetupError("ceiling", problem)
    changed = replace(room, ceiling_z=ceiling)
    if not changed.lowest_ceiling > changed.floor_z:
        raise SetupError(
            "ceiling", f"comes down to {changed.lowest_ceiling:g} m between the walls; give more"
        )
    return changed


def _refuse_empty(**given: str | None) -> None:
    """A script's variable that is empty must not fly what is usual."""
    for key, text in given.items():
        if text is not None and not text.strip():
            raise SetupError(key, "is empty; say what it is, or leave it out")


def _only_drone(lab: LabFile | None) -> str:
    if lab is None:
        raise SetupError("drone", _MISSING)
    if len(lab.drones) > 1:
        several = ", ".join(f"{one.uri} ({one.subject or lab.mocap.subject})" for one in lab.drones)
        raise SetupError("drone", f"{lab.file} has several; name one of {several}")
    return lab.drones[0].uri


def _mocap(lab: LabFile | None, drone: LabDrone | None) -> str:
    if lab is None:
        raise SetupError("mocap", _MISSING)
    if drone is None and len(lab.drones) > 1:
        raise SetupError("mocap", f"{lab.file} has several drones, not this one; name its poses too")
    return lab.mocap_uri(drone)


def _check_subject(lab: LabFile, drone: LabDrone | None, mocap: str) -> None:
    """A transform holds for the marker body that it was measured on."""
    theirs, ours = split_subject(mocap)[1], split_subject(lab.mocap_uri(drone))[1]
    if theirs != ours and lab.mocap.subject_to_body != SubjectToBody():
        raise SetupError(
            "mocap",
            f"subject_to_body of {lab.file} is that of {ours}, and {mocap} asks for another subject; "
            "fly with a lab file of that subject",
        )
