"""Starts whose numbers are in another unit, sign or order than they should be.

The simulation would fly them all the same, and its error would be called a gap of the vehicle file. Each
limit is beyond what any vehicle or sensor does, and the flips decide the signs: no model is judged here.
"""

from typing import Any

import numpy as np

from calibration.flights import Flight, UnusableFlightError
from calibration.gap.data.plausible import MOST_SPEED, check_range, check_upright
from calibration.gap.data.samples import samples_of
from calibration.gap.landings.segments import LandingSegment
from onboard.arrays import FloatArray

MOST_RATE = 150.0
"""rad/s, 8600 deg/s: no gyro that flies on such a vehicle reaches it; a flip of 20 rad/s in deg/s does."""

CARRIED = (0.2, 10.0)
"""Share of its weight that a vehicle's motors may carry when it triggers; the authors' carry 1.0 to 1.4."""

MOST_MOMENT = 10.0
"""Times what the motors of an axis can do at most."""

MOST_DISTANCE = 10.0
"""m to the ceiling at the trigger: the authors' drone had 0.25 to 0.62."""

_TURNED = (0.05, 0.12)  # s after the trigger: the lag of the motors is over, the contact still to come
_TURNS = 3.0  # rad/s of change that tell a direction


def check_units(
    flight: Flight, around: LandingSegment, thrust: FloatArray, moment: float, state: Any, p: Any
) -> None:
    """Refuse a start that cannot be meant.

    Args:
        flight: with a trigger. around: its gyro and poses around that.
        thrust: N (4,), that the motors had at the trigger.
        moment: N m, of the flip.
        state: state at the trigger. p: physics parameters.

    Raises:
        UnusableFlightError: something is in another unit, sign or order; the message says what to convert.
    """
    motors = samples_of(flight, "m1", "m2", "m3", "m4")
    if motors is not None and not flight.has("f1", "f2", "f3", "f4"):
        check_range(flight, motors)
    check_upright(flight, around.pose[:, :4])
    why = _why_not(flight, around, thrust, moment, state, p)
    if why is not None:
        raise UnusableFlightError(flight.source, why)


def _why_not(
    flight: Flight, around: LandingSegment, thrust: FloatArray, moment: float, state: Any, p: Any
) -> str | None:
    fastest = float(np.max(np.abs(around.gyro)))
    if fastest > MOST_RATE:
        return f"the gyro shows {fastest:.0f} rad/s: it seems to be in deg/s; convert it to rad/s"
    carried = float(thrust.sum() / (p["mass"] * p["gravity"]))
    if not CARRIED[0] < carried < CARRIED[1]:
        return (
            f"the motors carry {carried:.2g} of the vehicle's weight at the trigger: m1 to m4 are 0 to 65535 "
            "and need vbat in V, f1 to f4 are in N"
        )
    speed = float(np.linalg.norm(state["velocity"]))
    if speed > MOST_SPEED:
        return f"flies at {speed:.0f} m/s: positions seem to be in mm or cm; bring them to m"
    if abs(moment) > MOST_MOMENT * 2.0 * p["thrust_max"] * p["arm_x"]:
        return f"a flip moment of {abs(moment):.3g} N m: a_rot seems to be in N mm; divide it by 1000"
    distance = (flight.ceiling_z or 0.0) - float(state["position"][2])
    if distance > MOST_DISTANCE:
        return f"the ceiling is {distance:.0f} m away at the trigger: d_ceil seems to be in mm; bring it to m"
    turned = _change_of_pitch_rate(around)
    if turned * moment < 0.0 and abs(turned) > _TURNS:
        return (
            f"turns nose {'up' if turned < 0.0 else 'down'}, and a_rot of {moment:+.3g} N m the other way: "
            "a negative a_rot and a negative gy are nose up"
        )
    return None


def _change_of_pitch_rate(around: LandingSegment) -> float:
    """Mean pitch rate (rad/s) in the flip less the last one before the trigger; 0 where no sample says so."""
    since = around.gyro_t - around.trigger
    rows = (since > _TURNED[0]) & (since < _TURNED[1])
    before = np.flatnonzero(since <= 0.0)
    if not rows.any() or not before.size:
        return 0.0
    return float(around.gyro[rows, 1].mean() - around.gyro[before[-1], 1])
