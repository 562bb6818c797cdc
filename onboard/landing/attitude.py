"""The landing state machine's own attitude: it follows the gyro, and slowly the estimate.

In 5 of the 29 triggered flights of the authors the pose jumped during the flip and cut the motors at 0 to 40
deg of real rotation (errata 8). An attitude that only the gyro turns during the flip cannot be moved by that.
"""

import math
from typing import Any

from onboard.app_interface import LandingState
from onboard.arrays import Quaternion, Vector
from onboard.jit import inner, kernel
from onboard.landing.model import LandingInputs
from onboard.rotation import (
    conjugate,
    from_rotation_vector,
    integrate,
    multiply,
    normalise,
)

_IDLE = int(LandingState.IDLE)
_FLIP = int(LandingState.FLIP)
_CUT = int(LandingState.CUT)
_FAULT = int(LandingState.FAULT)

ATTITUDE_GAIN = 5.0
"""1/s. How fast the own attitude follows the estimate outside the flip."""

ATTITUDE_RATE = 0.5
"""rad/s. Fastest correction while flying: a bad pose that lasts 10 ms moves it by 0.3 deg at most."""

ATTITUDE_RATE_IDLE = 20.0
"""rad/s. Fastest correction while nothing depends on it."""


@kernel
def is_finite(v: Vector) -> bool:
    """Whether all three parts are finite."""
    return math.isfinite(v[0]) and math.isfinite(v[1]) and math.isfinite(v[2])


@inner
def _is_attitude(q: Quaternion) -> bool:
    return math.isfinite(q[0] + q[1] + q[2] + q[3])


@inner
def own_attitude(memory: Any) -> Quaternion:
    """The attitude that the machine keeps, body to world."""
    a = memory.attitude
    return (a[0], a[1], a[2], a[3])


@inner
def propagate_attitude(memory: Any, inputs: LandingInputs) -> None:
    """Turn the own attitude by the gyro, and outside the flip a little towards the estimate."""
    estimate = normalise(inputs.quaternion)
    usable = _is_attitude(estimate)
    if memory.attitude_known == 0:
        if not usable:
            return
        memory.attitude_known = 1
        attitude = estimate
    else:
        attitude = own_attitude(memory)
        if is_finite(inputs.gyro) and 0.0 < inputs.dt < 0.1:
            turned = integrate(attitude, inputs.gyro, inputs.dt)
            if _is_attitude(turned):  # Rates can be finite whose sum of squares is not.
                attitude = turned
    if usable and memory.state != _FLIP and 0.0 < inputs.dt < 0.1:
        error = multiply(conjugate(attitude), estimate)
        sign = 2.0 if error[3] >= 0.0 else -2.0
        x, y, z = sign * error[0], sign * error[1], sign * error[2]
        size = math.sqrt(x * x + y * y + z * z)
        loose = memory.state in (_IDLE, _CUT, _FAULT)
        most = (ATTITUDE_RATE_IDLE if loose else ATTITUDE_RATE) * inputs.dt
        share = min(ATTITUDE_GAIN * inputs.dt, 1.0)
        if share * size > most:
            share = most / size
        attitude = normalise(multiply(attitude, from_rotation_vector((share * x, share * y, share * z))))
    for i in range(4):
        memory.attitude[i] = attitude[i]
