"""When a vehicle rests on the floor, and when it flies clear of floor and ceiling."""

import numpy as np

from calibration.flights.flight import Flight, UnusableFlightError
from calibration.gap.data.samples import samples_of
from onboard.arrays import BoolArray, FloatArray

AIRBORNE_PWM = 8000.0
"""All four motors above this: in the air (or trying)."""

LEAST_FLYING_S = 1.0
"""A flight with less time in free flight is of no use."""

_END_S = 1.0  # dropped after take-off and before touch-down
_DIP_S = 1.0  # a throttle chop or a saturated mixer may take a motor below AIRBORNE_PWM for this long
_CLEAR_M = 0.03  # height above rest from which nothing touches the floor
_LOW_M = 0.15  # a flight that stays below and touches, or has saturated motors, never left the floor
_SATURATED_PWM = 65000.0
CONTACT_MARGIN_S = 0.1
"""s around a contact: no free flight."""

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


def free_flight(
    flight: Flight, t: FloatArray, pwm: FloatArray, position: FloatArray, rest: BoolArray
) -> BoolArray:
    """Samples in the air, clear of floor and ceiling, before any trigger; shape (n,).

    Args:
        flight: where trigger and contacts are from.
        t: s, shape (n,), uniform.
        pwm: shape (n, 4).
        position: m, shape (n, 3).
        rest: :func:`resting`.

    Raises:
        UnusableFlightError: there are too few; names the reason.
    """
    flying = airborne(t, pwm)
    if not flying.any():
        raise UnusableFlightError(flight.source, "never flies: the motors hardly run")
    height = position[:, 2] - (float(np.median(position[rest, 2])) if rest.any() else 0.0)
    _check_leaves_floor(flight, height[flying], pwm[flying])
    flying &= height > _CLEAR_M  # low hovering stays in: ground effect shows only there
    if flight.trigger is not None:  # the landing has an analysis of its own
        flying &= t < flight.trigger.t
    for name in ("body_contact", "legs_attached"):
        touch = samples_of(flight, name)
        if touch is not None:
            flying &= ~near(t, touch.t[touch.values[:, 0] > 0.0], CONTACT_MARGIN_S)
    seconds = np.count_nonzero(flying) * float(t[1] - t[0])
    if seconds < LEAST_FLYING_S:
        raise UnusableFlightError(flight.source, f"only {seconds:.2f} s in free flight")
    return flying


def airborne(t: FloatArray, pwm: FloatArray) -> BoolArray:
    """The longest time with all motors above :data:`AIRBORNE_PWM`, short dips included, less 1 s at each end.

    Nothing is dropped where the record itself begins or ends in the air.
    """
    result = np.zeros(t.size, dtype=np.bool_)
    index = np.flatnonzero(np.all(pwm > AIRBORNE_PWM, axis=1))
    if index.size == 0:
        return result
    breaks = np.flatnonzero(np.diff(t[index]) > _DIP_S)
    starts = index[np.concatenate([[0], breaks + 1])]
    ends = index[np.concatenate([breaks, [index.size - 1]])]
    longest = int(np.argmax(t[ends] - t[starts]))
    start, end = int(starts[longest]), int(ends[longest])
    first = t[start] + (_END_S if start > 0 else 0.0)
    last = t[end] - (_END_S if end < t.size - 1 else 0.0)
    result[(t >= first) & (t <= last)] = True
    return result


def _check_leaves_floor(flight: Flight, height: FloatArray, pwm: FloatArray) -> None:
    """Refuse a vehicle that runs its motors on the floor, or hops.

    Raises:
        UnusableFlightError: it does.
    """
    touching = float(np.mean(height < _CLEAR_M))
    saturated = float(np.mean(np.any(pwm > _SATURATED_PWM, axis=1)))
    if height.max() < _LOW_M and -height.min() > _LOW_M:
        raise UnusableFlightError(
            flight.source,
            f"flies below the floor (down to {height.min():.2f} m): z seems to point down; bring position "
            "and attitude into a frame whose z points up",
        )
    if height.max() < _LOW_M and (touching > 0.1 or saturated > 0.5):
        raise UnusableFlightError(
            flight.source,
            f"stays on the floor with the motors running (highest {height.max():.2f} m, on the floor"
            f" {touching:.0%} and motors saturated {saturated:.0%} of the time)",
        )


def near(t: FloatArray, moments: FloatArray, margin: float) -> BoolArray:
    """Where a time of `t` has one of the increasing `moments` within `margin` (s)."""
    return np.searchsorted(moments, t + margin, "right") > np.searchsorted(moments, t - margin, "left")
