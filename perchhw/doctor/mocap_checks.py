"""Motion capture: health, rate, latency, and its up against the drone's own."""

import math
from collections.abc import Callable

from mocap_bridge.health import HealthLimits, PoseVerdict
from onboard.arrays import Quaternion, Vector
from perchhw.doctor.check_result import CheckResult, judged, not_known
from perchhw.doctor.readings import DroneReadings, MocapReadings, Readings

RATE = 90.0
"""Hz: 100 is what the estimator and the safety rules were tried with."""

TILT_DEG = 5.0
"""deg between the vertical of the poses and that of the accelerometer; markers are put on within 2 deg."""

STILL = (0.9, 1.1)
"""g: what the accelerometer of a drone shows that stands still."""


def mocap(readings: MocapReadings, _: Readings) -> CheckResult:
    """The health monitor's verdict."""
    measured = readings.verdict if readings.error is None else f"{readings.verdict} ({readings.error})"
    return judged(
        "mocap",
        readings.verdict == PoseVerdict.OK.value,
        measured,
        PoseVerdict.OK.value,
        "the drone knows where it is by it",
        "is the subject tracked, its name right, the stream on? perchhw mocap watch says more",
    )


def mocap_rate(readings: MocapReadings, _: Readings) -> CheckResult:
    """Frames a second."""
    return judged(
        "mocap_rate",
        readings.rate >= RATE,
        f"{readings.rate:.0f} Hz",
        f"{RATE:.0f} Hz",
        "between two poses the drone dead-reckons",
        "raise the frame rate of the system; use a cable instead of Wi-Fi",
    )


def mocap_latency(readings: MocapReadings, _: Readings) -> CheckResult:
    """Age of the poses at receipt."""
    limit = HealthLimits().late_warning
    wanted, why = f"{1e3 * limit:.0f} ms", "at 3 m/s a pose of 35 ms is 10 cm behind"
    if readings.age is None:
        remedy = "give mocap.latency_s in the lab file, or take a source that tells it (vicon://)"
        return not_known("mocap_latency", "the source does not tell it", wanted, why, remedy)
    remedy = "use a cable instead of Wi-Fi; do less on the computer that runs the system"
    return judged("mocap_latency", readings.age <= limit, f"{1e3 * readings.age:.1f} ms", wanted, why, remedy)


def mocap_frame(readings: MocapReadings, all_readings: Readings) -> CheckResult | None:
    """Where the poses say that up is, in the body, against the accelerometer."""
    drone = all_readings.drone
    if not isinstance(drone, DroneReadings):
        return None
    wanted = f"{TILT_DEG:g} deg"
    why = "an estimator that is told a turned attitude diverges; a turned heading shows in motion only"
    remedy = "is z up in the room? Put the drone level, define the subject anew, or give subject_to_body"
    if readings.attitude is None or drone.acceleration is None:
        return not_known("mocap_frame", "no pose, or no acceleration", wanted, why, "see the lines above")
    size = math.hypot(*drone.acceleration)
    if not STILL[0] <= size <= STILL[1]:
        return not_known("mocap_frame", f"the drone moves ({size:.2f} g)", wanted, why, "let it stand still")
    angle = math.degrees(_angle(up_of(readings.attitude), drone.acceleration))
    return judged("mocap_frame", angle <= TILT_DEG, f"{angle:.1f} deg apart", wanted, why, remedy)


def up_of(q: Quaternion) -> Vector:
    """The world's z axis in the body frame."""
    x, y, z, w = q
    return 2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)


def _angle(a: Vector, b: Vector) -> float:
    inner = sum(p * q for p, q in zip(a, b, strict=True))
    return math.acos(min(1.0, max(-1.0, inner / (math.hypot(*a) * math.hypot(*b)))))


CHECKS: tuple[Callable[[MocapReadings, Readings], CheckResult | None], ...] = (
    mocap,
    mocap_rate,
    mocap_latency,
    mocap_frame,
)
