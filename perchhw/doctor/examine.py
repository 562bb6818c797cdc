"""From readings to lines."""

from perchhw.doctor import drone_checks, host_checks, mocap_checks
from perchhw.doctor.check_result import CheckResult, judged
from perchhw.doctor.readings import DroneReadings, Readings


def examine(readings: Readings) -> tuple[CheckResult, ...]:
    """Every check that applies to what was asked for, in the order in which a person would look."""
    found = [check(readings) for check in host_checks.CHECKS]
    drone, mocap = readings.drone, readings.mocap
    if isinstance(drone, DroneReadings):
        found += [check(drone, readings) for check in drone_checks.CHECKS]
    elif drone is not None:
        found.append(_no_link(drone, readings))
    if mocap is not None:
        found += [check(mocap, readings) for check in mocap_checks.CHECKS]
    return tuple(finding for finding in found if finding is not None)


def _no_link(problem: str, readings: Readings) -> CheckResult:
    uri = readings.drone_uri or ""
    remedy = "is it on, its battery charged, the address that of its own configuration?"
    if uri.startswith("radio:") and not readings.host.usb:
        remedy = "plug in a Crazyradio first: no drone was asked"
    return judged("link", False, problem, f"{uri} answers", "nothing works without it", remedy)
