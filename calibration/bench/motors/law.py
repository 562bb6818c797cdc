"""How a rotor's speed follows a step of its command: the speed law and the alternatives it is judged against.

Speed law, with w the speed and ws the settled one: dw/dt = a (ws - w) + b (ws^2 - w^2). b is the drag of the
propeller over the rotor's inertia, a what the conducting winding (back electromotive force) or friction adds.
With x = w - ws and alpha = a + 2 b ws this is Riccati's equation dx/dt = -alpha x - b x^2; the angle turned
has the closed form ws t + ln(1 + b x0 (1 - e^(-alpha t)) / alpha) / b (bench notes 1.2).

Every law gives the mean speed over stretches of time: that is what both a window and whole revolutions
measure, so that averaging costs no accuracy.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from onboard.arrays import FloatArray

_SMALLEST_B = 1e-12
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(6)

MeanSpeed = Callable[[FloatArray, FloatArray, FloatArray, FloatArray, FloatArray, FloatArray], FloatArray]
"""(start, end, t0, w0, ws, shared parameters) -> mean speed between start and end; t0, w0, ws per sample."""


def riccati_speed(t: FloatArray, w0: FloatArray, ws: FloatArray, a: float, b: float) -> FloatArray:
    """Speed (rad/s) at `t` (s) after a step from `w0` towards `ws`; `w0` before it."""
    after = np.maximum(t, 0.0)
    decay = np.exp(-(a + 2.0 * b * ws) * after)
    return ws + (w0 - ws) * decay / (1.0 + b * (w0 - ws) * _lag(after, a + 2.0 * b * ws))


def riccati_angle(t: FloatArray, w0: FloatArray, ws: FloatArray, a: float, b: float) -> FloatArray:
    """Angle (rad) turned since the step; negative before it."""
    after = np.maximum(t, 0.0)
    lag = (w0 - ws) * _lag(after, a + 2.0 * b * ws)
    turned = lag if b < _SMALLEST_B else np.log1p(b * lag) / b
    return w0 * np.minimum(t, 0.0) + ws * after + turned


def _lag(t: FloatArray, alpha: FloatArray) -> FloatArray:
    """(1 - e^(-alpha t)) / alpha, also for alpha = 0."""
    from scipy.special import exprel

    return np.asarray(t * exprel(-alpha * t))


def _mean_of_angle(a: float, b: float, window: tuple[FloatArray, ...]) -> FloatArray:
    start, end, t0, w0, ws = window
    turned = riccati_angle(end - t0, w0, ws, a, b) - riccati_angle(start - t0, w0, ws, a, b)
    return turned / (end - start)


def _speed_law(
    start: FloatArray, end: FloatArray, t0: FloatArray, w0: FloatArray, ws: FloatArray, shared: FloatArray
) -> FloatArray:
    return _mean_of_angle(shared[0], shared[1], (start, end, t0, w0, ws))


def _drag_only(
    start: FloatArray, end: FloatArray, t0: FloatArray, w0: FloatArray, ws: FloatArray, shared: FloatArray
) -> FloatArray:
    return _mean_of_angle(0.0, shared[0], (start, end, t0, w0, ws))


def _speed_first_order(
    start: FloatArray, end: FloatArray, t0: FloatArray, w0: FloatArray, ws: FloatArray, shared: FloatArray
) -> FloatArray:
    return _mean_of_angle(1.0 / shared[0], 0.0, (start, end, t0, w0, ws))


def _thrust_first_order(
    start: FloatArray, end: FloatArray, t0: FloatArray, w0: FloatArray, ws: FloatArray, shared: FloatArray
) -> FloatArray:
    """w^2 settles as e^(-t / tau); Gauss-Legendre over the part of the stretch that lies after the step."""
    begin = np.maximum(start, t0)
    length = np.maximum(end - begin, 0.0)
    at = begin[:, None] + 0.5 * length[:, None] * (1.0 + _NODES)
    decay = np.exp(-np.maximum(at - t0[:, None], 0.0) / shared[0])
    square = ws[:, None] ** 2 + (w0**2 - ws**2)[:, None] * decay
    turned = 0.5 * length * (np.sqrt(np.maximum(square, 0.0)) @ _WEIGHTS)
    return np.asarray((turned + w0 * (end - start - length)) / (end - start))


@dataclass(frozen=True, slots=True)
class Law:
    """A law with the parameters that all steps of one direction share.

    Attributes:
        name: for reports and scripts.
        equation: in words of the field.
        parameters: names of the shared parameters.
        units: theirs.
        start: where a fit begins.
        low, high: bounds.
        mean_speed: see :data:`MeanSpeed`.
    """

    name: str
    equation: str
    parameters: tuple[str, ...]
    units: tuple[str, ...]
    start: tuple[float, ...]
    low: tuple[float, ...]
    high: tuple[float, ...]
    mean_speed: MeanSpeed


SPEED_LAW = Law(
    "speed_law",
    "dw/dt = a (ws - w) + b (ws^2 - w^2)",
    ("a", "b"),
    ("1/s", "1/rad"),
    (1.0, 3e-3),
    (-20.0, 1e-6),
    (60.0, 0.1),
    _speed_law,
)
DRAG_ONLY = Law(
    "drag_only", "dw/dt = b (ws^2 - w^2)", ("b",), ("1/rad",), (3e-3,), (1e-6,), (0.1,), _drag_only
)
SPEED_FIRST_ORDER = Law(
    "speed_first_order",
    "dw/dt = (ws - w) / tau",
    ("tau",),
    ("s",),
    (0.1,),
    (1e-3,),
    (5.0,),
    _speed_first_order,
)
THRUST_FIRST_ORDER = Law(
    "thrust_first_order",
    "d(w^2)/dt = (ws^2 - w^2) / tau",
    ("tau",),
    ("s",),
    (0.1,),
    (1e-3,),
    (5.0,),
    _thrust_first_order,
)
LAWS = (SPEED_LAW, DRAG_ONLY, SPEED_FIRST_ORDER, THRUST_FIRST_ORDER)
"""The speed law first; the others are there to be compared with it."""
