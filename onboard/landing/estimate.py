"""Whether the drone's own estimate is fit to fly by while the landing machine brakes and holds.

Without poses the estimate goes on by dead reckoning, and braking on that is far gentler than a fall: after
3.5 s blind the simulated drone's is wrong by 0.3 m and 0.1 m/s (docs/safety.md). So it is not the age of the
last pose that makes an estimate useless, but numbers that cannot be true.
"""

import math
from typing import Any

from onboard.app_interface import LandingState
from onboard.jit import inner
from onboard.landing.attitude import is_finite
from onboard.landing.braking import hold_setpoint
from onboard.landing.model import LandingInputs, LandingLimits
from onboard.trajectory import ApproachPlan

_HOLD = int(LandingState.HOLD)


@inner
def estimate_is_finite(inputs: LandingInputs) -> bool:
    """Whether attitude, position and velocity are numbers."""
    q = inputs.quaternion
    attitude = math.isfinite(q[0] + q[1] + q[2] + q[3])
    return attitude and is_finite(inputs.position) and is_finite(inputs.velocity)


@inner
def has_pose(inputs: LandingInputs, limits: LandingLimits) -> bool:
    """Whether an external pose arrived not long ago."""
    return inputs.pose_age <= limits.pose_age_limit


@inner
def _distance(a: Any, b: Any) -> float:
    dx, dy, dz = a[0] - b[0], a[1] - b[1], a[2] - b[2]
    return math.sqrt(dx * dx + dy * dy + dz * dz)


@inner
def estimate_is_usable(memory: Any, inputs: LandingInputs, plan: ApproachPlan, limits: LandingLimits) -> bool:
    """Whether to brake and hold by the estimate: finite, no faster than possible, and in a blind hold near
    its setpoint, from which only an estimate that was reset or has run away can be far."""
    if not (estimate_is_finite(inputs) and is_finite(inputs.gyro)):
        return False
    if not _distance(inputs.velocity, (0.0, 0.0, 0.0)) <= limits.speed_limit:
        return False
    if memory.state != _HOLD or has_pose(inputs, limits):
        return True
    goal, _, _ = hold_setpoint(memory, inputs.time, plan, limits)
    return _distance(inputs.position, goal) <= limits.hold_distance
