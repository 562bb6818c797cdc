"""When a vehicle rests on the floor, and when it flies clear of floor and ceiling."""

import numpy as np

from onboard.arrays import BoolArray, FloatArray

AIRBORNE_PWM = 8000.0
"""All four motors above this: in the air (or trying)."""

_END_S = 1.0  # dropped after take-off and before touch-down
_DIP_S = 1.0  # a throttle chop or a saturated mixer may take a motor below AIRBORNE_PWM for this long
_CLEAR_M = 0.03  # height above rest from which nothing touches the floor
_SETTLED_S = 0.3  # nothing is at rest this shortly before the motors start
_RESTING_RATE = 0.2  # rad/s
_RESTING_MOVE_M = 0.005


def resting(t: FloatArray, pwm: FloatArray, rate: FloatArray, position: FloatArray) -> BoolArray:
    """On the floor with the motors off, before they first start; shape (n,).

    Args:
        t: s, shape (n,).
        pwm: shape (n, 4).
        rate: rad/s, shape (n, 3).
        position: m, shape (n, 3).
    """
    running = np.any(pwm > 0.0, axis=1)
    if not running.any():
        return np.zeros(t.size, dtype=np.bool_)
    still = (t < t[int(np.argmax(running))] - _SETTLED_S) & (np.linalg.norm(rate, axis=1) < _RESTING_RATE)
    if still.any():
        middle = np.median(position[still], axis=0)
        still &= np.linalg.norm(position - middle, axis=1) < _RESTING_MOVE_M
    return still


def airborne(t: FloatArray, pwm: FloatArray, alive: BoolArray) -> BoolArray:
    """The longest time with all motors above :data:`AIRBORNE_PWM`, short dips included, less 1 s at each end.

    Nothing is dropped at an end where the record itself begins or ends in the air.

    Args:
        t: s, shape (n,), uniform.
        pwm: shape (n, 4).
        alive: where the log was not dead, shape (n,).
    """
    up = np.all(pwm > AIRBORNE_PWM, axis=1) & alive
    result = np.zeros(t.size, dtype=np.bool_)
    index = np.flatnonzero(up)
    if index.size == 0:
        return result
    breaks = np.flatnonzero(np.diff(t[index]) > _DIP_S)
    starts = index[np.concatenate([[0], breaks + 1])]
    ends = index[np.concatenate([breaks, [index.size - 1]])]
    longest = int(np.argmax(t[ends] - t[starts]))
    start, end = int(starts[longest]), int(ends[longest])
    first = t[start] + (_END_S if start > 0 else 0.0)
    dead_end = end + 1 < t.size and not alive[end + 1]
    last = t[end] - (0.0 if end == t.size - 1 or dead_end else _END_S)
    result[(t >= first) & (t <= last)] = True
    return result


def clear_of_floor(position: FloatArray, rest: BoolArray) -> BoolArray:
    """Height (m) above that of rest, or above the floor at z = 0 without a rest, enough that nothing touches.

    Low hovering stays in: ground effect shows only there.
    """
    z = position[:, 2]
    floor = float(np.median(z[rest])) if rest.any() else 0.0
    return z > floor + _CLEAR_M
