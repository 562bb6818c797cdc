"""The computer, the files: disk, USB rights, lab file, vehicle file."""

from collections.abc import Callable

from onboard.attitude_margins import DELAY_LIMIT, PHASE_LIMIT_DEG, vehicle_margins
from perchhw.doctor.check_result import CheckResult, judged, not_known
from perchhw.doctor.readings import Readings

DISK_FREE = 1_000_000_000
"""Bytes: a day of attempts; one attempt of 15 s records about 2 MB."""


def disk(readings: Readings) -> CheckResult:
    """A record that cannot be written ends a campaign."""
    host = readings.host
    wanted, why = f"{DISK_FREE / 1e9:g} GB free and writable", "every flight is recorded as it goes on"
    remedy = "free some space, or name a folder on another disk (--out)"
    if host.disk_problem is not None:
        return judged("disk", False, f"{host.folder}: {host.disk_problem}", wanted, why, remedy)
    if host.disk_free is None:
        return not_known("disk", f"{host.folder}: free space is not told", wanted, why, remedy)
    measured = f"{host.disk_free / 1e9:.1f} GB free in {host.folder}"
    return judged("disk", host.disk_free >= DISK_FREE, measured, wanted, why, remedy)


def usb(readings: Readings) -> CheckResult | None:
    """Only a drone by radio or cable needs USB."""
    uri = readings.drone_uri or ""
    if not uri.startswith(("radio:", "usb:")):
        return None
    devices = readings.host.usb
    wanted, why = "a Crazyradio or Crazyflie that this user may use", f"{uri} is reached by it"
    if not devices:
        return judged(
            "usb", False, "none plugged in", wanted, why, "plug it in; in a virtual machine, pass it on"
        )
    measured = ", ".join(f"{d.name} at {d.node}{'' if d.usable else ', no rights'}" for d in devices)
    remedy = (
        "add Bitcraze's udev rules (bitcraze.io, USB permissions), put this user into group plugdev, and "
        "plug it in again"
    )
    return judged("usb", any(device.usable for device in devices), measured, wanted, why, remedy)


def lab_file(readings: Readings) -> CheckResult | None:
    """On hardware nothing flies without one."""
    problem = readings.host.lab_problem
    if problem is None:
        return None
    return judged(
        "lab_file",
        False,
        "none",
        "a lab file of this room",
        "walls, ceiling and limits are never guessed",
        problem,
    )


def attitude_loop(readings: Readings) -> CheckResult:
    """The vehicle file says whether the law has margin enough."""
    margins = vehicle_margins(readings.vehicle)
    return judged(
        "attitude_loop",
        margins.suffice,
        f"{margins.phase_deg:.0f} deg and {1e3 * margins.delay:.0f} ms with {readings.vehicle.name}",
        f"{PHASE_LIMIT_DEG:.0f} deg and {1e3 * DELAY_LIMIT:.0f} ms",
        "with less the attitude loop may be lost in flight",
        "measure motors and inertia (perchhw calibrate), then perchhw vehicle check",
    )


CHECKS: tuple[Callable[[Readings], CheckResult | None], ...] = (disk, usb, lab_file, attitude_loop)
