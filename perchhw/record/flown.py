"""What flew, as a record names it."""

from typing import Any

from onboard.errors import InputError
from onboard.policy.bundle import policy_crc32
from onboard.policy.files import find_policy, load_policy
from onboard.policy.model import Policy
from onboard.record.run_record import RunRecord
from onboard.vehicle import Vehicle, VehicleFileError, load_vehicle
from perchhw.attempt import DEFAULT_VEHICLE


def vehicle_of(config: dict[str, Any]) -> Vehicle:
    """The vehicle of a run's configuration, or the usual one where it names none.

    Raises:
        VehicleFileError: it is not known here.
    """
    return load_vehicle(config.get("vehicle") or DEFAULT_VEHICLE, config.get("legs"))


def known_vehicle_of(run: RunRecord) -> Vehicle | None:
    """The vehicle that the record names, or None where its file is not at hand."""
    try:
        return vehicle_of(run.config)
    except VehicleFileError:
        return None


def policy_of(run: RunRecord) -> Policy | None:
    """The policy that the record names, unless its file is gone or has changed since."""
    name, crc = run.config.get("policy"), run.config.get("policy_crc32")
    if not isinstance(name, str):
        return None
    try:
        policy = load_policy(find_policy(name))
    except (InputError, OSError):
        return None
    return policy if crc in (None, f"{policy_crc32(policy):08x}") else None
