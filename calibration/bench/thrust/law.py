"""Forms of thrust map: those that a vehicle file may hold, and those of the literature to compare with.

f is the thrust of one motor, V the voltage at it. Inside a fit f is in gram-force, where all coefficients are
of order one; results are given in SI. Sources: bench notes 2 (our analysis of the paper's table and of the
authors' code); Bitcraze, crazyflie-firmware (cubic); the ideal DC motor with f = k w^2 (DC).
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from onboard.arrays import FloatArray

BREAK_GF = 5.0
"""gf at which the paper changes from one row of its table to the other."""
_LARGEST_EXPONENT = 50.0

Curve = Callable[[FloatArray, FloatArray], FloatArray]
"""(parameters, x) -> y."""


@dataclass(frozen=True, slots=True)
class Form:
    """A form f(V).

    Attributes:
        name: for reports and scripts.
        equation: with f in gf and V in volts.
        parameters: names; a fit's own parameters, which need not be a file's coefficients.
        thrust: f (gf) from V.
        voltage: V from f (gf), for f > 0; NaN where there is none.
        start: where a fit begins, from the data (V, f).
        in_vehicle: whether vehicle files have it.
        low, high: bounds of every parameter.
    """

    name: str
    equation: str
    parameters: tuple[str, ...]
    thrust: Curve
    voltage: Curve
    start: Callable[[FloatArray, FloatArray], FloatArray]
    in_vehicle: bool = False
    low: float = -np.inf
    high: float = np.inf


def bisected(rising: Callable[[FloatArray], FloatArray], f: FloatArray, highest: float = 16.0) -> FloatArray:
    """V in 0..`highest` at which a rising curve gives `f`; NaN where it does not in that range."""
    low, high = np.zeros(f.shape), np.full(f.shape, highest)
    bracketed = (rising(low) <= f) & (rising(high) >= f)
    for _ in range(60):
        middle = 0.5 * (low + high)
        above = rising(middle) > f
        high = np.where(above, middle, high)
        low = np.where(above, low, middle)
    return np.where(bracketed, 0.5 * (low + high), np.nan)


def _line(x: FloatArray, y: FloatArray) -> FloatArray:
    """Level and slope of the line through points."""
    return np.asarray(np.linalg.lstsq(np.stack([np.ones(x.size), x], axis=1), y, rcond=None)[0])


def _polynomial_start(powers: tuple[int, ...]) -> Callable[[FloatArray, FloatArray], FloatArray]:
    def start(v: FloatArray, f: FloatArray) -> FloatArray:
        columns = np.stack([v**power for power in powers], axis=1)
        return np.asarray(np.linalg.lstsq(columns, f, rcond=None)[0])

    return start


def _polynomial_form(name: str, equation: str, powers: tuple[int, ...], in_vehicle: bool = False) -> Form:
    def thrust(p: FloatArray, v: FloatArray) -> FloatArray:
        return np.asarray(np.stack([v**power for power in powers], axis=-1) @ p)

    def voltage(p: FloatArray, f: FloatArray) -> FloatArray:
        return bisected(lambda v: thrust(p, v), f)

    names = tuple(f"c{power}" for power in powers)
    return Form(name, equation, names, thrust, voltage, _polynomial_start(powers), in_vehicle)


def _log_pair_thrust(p: FloatArray, v: FloatArray) -> FloatArray:
    a1, b1, a2, b2 = np.exp(p)
    corner = a1 * np.log1p(BREAK_GF / b1)
    lower = b1 * np.expm1(np.minimum(np.minimum(v, corner) / a1, _LARGEST_EXPONENT))
    beyond = np.minimum((np.maximum(v, corner) - corner) / a2, _LARGEST_EXPONENT)
    return np.where(v <= corner, lower, (BREAK_GF + b2) * np.exp(beyond) - b2)


def _log_pair_voltage(p: FloatArray, f: FloatArray) -> FloatArray:
    a1, b1, a2, b2 = np.exp(p)
    lower = a1 * np.log1p(np.minimum(f, BREAK_GF) / b1)
    return np.asarray(lower + a2 * np.log((np.maximum(f, BREAK_GF) + b2) / (BREAK_GF + b2)))


def _log_pair_start(v: FloatArray, f: FloatArray) -> FloatArray:
    """Both regions as bent as small motors are, scaled to the voltage of the middle of the data."""
    shape = np.log(np.array([1.5, 2.0, 2.5, 5.0]))
    middle = float(np.median(f))
    ratio = float(np.median(v)) / float(_log_pair_voltage(shape, np.array([middle]))[0])
    return shape + np.log(max(ratio, 1e-2)) * np.array([1.0, 0.0, 1.0, 0.0])


def _two_quadratic_corner(p: FloatArray) -> float:
    """V at which the lower row reaches the break thrust."""
    root = float(np.sqrt(max(p[1] ** 2 + 4.0 * p[0] * BREAK_GF, 1e-9)))
    return 2.0 * BREAK_GF / max(float(p[1]) + root, 1e-9)


def _two_quadratic_thrust(p: FloatArray, v: FloatArray) -> FloatArray:
    corner = _two_quadratic_corner(p)
    above = v - corner
    return np.where(v <= corner, v * (p[1] + p[0] * v), BREAK_GF + above * (p[3] + p[2] * above))


def _two_quadratic_voltage(p: FloatArray, f: FloatArray) -> FloatArray:
    return bisected(lambda v: _two_quadratic_thrust(p, v), f)


def _two_quadratic_start(v: FloatArray, f: FloatArray) -> FloatArray:
    a, b = _polynomial_start((2, 1))(v, f)
    return np.array([a, b, a, b + 2.0 * a * _two_quadratic_corner(np.array([a, b]))])


def _text_log_thrust(p: FloatArray, v: FloatArray) -> FloatArray:
    a, b = np.exp(p[:2])
    return np.asarray(np.exp(np.minimum((v - p[2]) / a, _LARGEST_EXPONENT)) - b)


def _text_log_voltage(p: FloatArray, f: FloatArray) -> FloatArray:
    a, b = np.exp(p[:2])
    return np.asarray(a * np.log(f + b) + p[2])


def _text_log_start(v: FloatArray, f: FloatArray) -> FloatArray:
    level, slope = _line(np.log(np.maximum(f + 3.0, 1.0)), v)  # also of a point that strays below zero
    return np.array([np.log(max(slope, 1e-2)), np.log(3.0), level])


def _dc_thrust(p: FloatArray, v: FloatArray) -> FloatArray:
    a2 = np.exp(p[2])
    root = np.sqrt(np.maximum(p[1] ** 2 + 4.0 * a2 * (v - p[0]), 0.0))
    return np.asarray(np.maximum((root - p[1]) / (2.0 * a2), 0.0) ** 2)


def _dc_voltage(p: FloatArray, f: FloatArray) -> FloatArray:
    return np.asarray(p[0] + p[1] * np.sqrt(f) + np.exp(p[2]) * f)


def _dc_start(v: FloatArray, f: FloatArray) -> FloatArray:
    columns = np.stack([np.ones(v.size), np.sqrt(np.maximum(f, 0.0)), f], axis=1)
    v0, a1, a2 = np.linalg.lstsq(columns, v, rcond=None)[0]
    return np.array([v0, a1, np.log(max(a2, 1e-3))])


def _square_thrust(p: FloatArray, v: FloatArray) -> FloatArray:
    return np.asarray((p[0] + p[1] * v) ** 2)


def _square_voltage(p: FloatArray, f: FloatArray) -> FloatArray:
    return np.asarray((np.sqrt(f) - p[0]) / p[1])


def _square_start(v: FloatArray, f: FloatArray) -> FloatArray:
    level, slope = _line(v, np.sqrt(np.maximum(f, 0.0)))
    return np.array([level, slope])


CUBIC = _polynomial_form("firmware_cubic", "f = c0 + c1 V + c2 V^2 + c3 V^3", (0, 1, 2, 3), True)
TWO_REGION_LOG = Form(
    "two_region_log",
    "V = a1 ln(1 + f/b1) to 5 gf, V(5) + a2 ln((f + b2)/(5 + b2)) above",
    ("ln a1", "ln b1", "ln a2", "ln b2"),
    _log_pair_thrust,
    _log_pair_voltage,
    _log_pair_start,
    True,
    -6.0,
    6.0,
)
TWO_QUADRATICS = Form(
    "two_quadratic",
    "f = a V^2 + b V to 5 gf, and a quadratic above that meets it",
    ("low_a", "low_b", "high_a", "high_slope"),
    _two_quadratic_thrust,
    _two_quadratic_voltage,
    _two_quadratic_start,
    True,
)
OTHERS = (
    _polynomial_form("cubic_through_zero", "f = c1 V + c2 V^2 + c3 V^3", (1, 2, 3)),
    _polynomial_form("quadratic_through_zero", "f = c1 V + c2 V^2", (1, 2)),
    Form(
        "text_log",
        "V = a ln(f + b) + c",
        ("ln a", "ln b", "c"),
        _text_log_thrust,
        _text_log_voltage,
        _text_log_start,
        low=-12.0,
        high=12.0,
    ),
    Form(
        "dc_motor",
        "V = v0 + a1 sqrt(f) + a2 f",
        ("v0", "a1", "ln a2"),
        _dc_thrust,
        _dc_voltage,
        _dc_start,
        low=-12.0,
        high=12.0,
    ),
    Form("square", "f = (p + q V)^2", ("p", "q"), _square_thrust, _square_voltage, _square_start),
)
"""For comparison only: vehicle files do not have them."""

VEHICLE_FORMS = (CUBIC, TWO_REGION_LOG, TWO_QUADRATICS)
FORMS = (*VEHICLE_FORMS, *OTHERS)
