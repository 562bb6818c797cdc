"""Which lab file counts: the one that is given, else ``lab.toml`` in the working folder."""

from collections.abc import Callable
from functools import partial
from pathlib import Path

from mocap_bridge.uri import parse_mocap_uri
from onboard.errors import InputError
from onboard.lab_file import LAB_FILE, LabFile, LabFileError, drone_addresses, read_lab_file
from onboard.lab_time import TimeAddress
from onboard.link.uri import check_drone_uri
from onboard.policy.files import find_policy, load_policy
from onboard.vehicle import load_vehicle
from perchhw.lab.flying import LIMITS


def find_lab(given: Path | None) -> LabFile | None:
    """The lab file that counts, or None where there is none.

    Raises:
        LabFileError: it cannot be used; the message has one line a problem, with file and key.
    """
    path = _place(given)
    return None if path is None else read_lab(path)


def drones_of(given: Path | None) -> list[str]:
    """Addresses of all drones of the lab file that counts, whatever else is wrong with it: for a stop.

    Raises:
        LabFileError: there is no lab file, or it cannot be read, or has no address of a drone in it.
    """
    path = _place(given)
    if path is None:
        raise LabFileError(
            f"no drone: there is no {LAB_FILE} in this folder; give --drone URI, or --lab FILE"
        )
    return drone_addresses(path).uris


def clock_of(given: Path | None) -> TimeAddress:
    """Where the simulated lab of the lab file that counts says what time it is.

    Raises:
        LabFileError: there is no lab file, or it is of a real room.
    """
    path = _place(given)
    if path is None:
        raise LabFileError(f"no lab: there is no {LAB_FILE} in this folder; give --lab FILE")
    clock = read_lab_file(path, LIMITS).clock
    host, _, port = (clock or "").rpartition(":")
    if not port.isdecimal():
        raise LabFileError(f"{path}: has no clock: it is not the file that `perchhw sim lab` wrote")
    return TimeAddress(host, int(port))


def _place(given: Path | None) -> Path | None:
    if given is not None:
        return given
    return LAB_FILE if LAB_FILE.exists() else None


def read_lab(path: Path) -> LabFile:
    """Read a lab file and check all of it, also that what it names can be used; nothing is connected.

    Raises:
        LabFileError: with every problem found, one a line.
    """
    lab = read_lab_file(path, LIMITS)
    checks: dict[str, Callable[[], object]] = {}
    for index, drone in enumerate(lab.drones):
        key = f"drones[{index}]"
        checks[f"{key}.uri"] = partial(check_drone_uri, drone.uri)
        checks[f"{key}.vehicle"] = partial(load_vehicle, lab.beside(drone.vehicle))
        if drone.legs is not None:
            checks[f"{key}.legs"] = partial(load_vehicle, lab.beside(drone.vehicle), drone.legs)
        if drone.policy is not None:
            checks[f"{key}.policy"] = partial(_load_policy, lab.beside(drone.policy))
    checks["mocap.uri"] = partial(parse_mocap_uri, lab.mocap_uri(None))
    problems = [f"{path}: {key}: {problem}" for key, check in checks.items() if (problem := _problem(check))]
    if problems:
        raise LabFileError("\n".join(problems))
    return lab


def _load_policy(policy: str) -> None:
    """Raises InputError for one that cannot be flown."""
    load_policy(find_policy(policy))


def _problem(check: Callable[[], object]) -> InputError | None:
    try:
        check()
    except InputError as problem:
        return problem
    return None
