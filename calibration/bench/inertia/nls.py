"""Least squares of the pendulum law, with or without a second mode."""

import math
from dataclasses import dataclass

import numpy as np

from calibration.bench.inertia.law import PendulumSwing
from calibration.bench.inertia.start import DampedSine, strongest_line
from onboard.arrays import FloatArray

_FIRST_CYCLES = 12.0  # fitted first, so that the phase of a long recording is not lost
_PENDULUM = 5  # parameters of the pendulum, before the offset
_MAX_ROOT = 0.2  # of an amplitude of 100 deg


@dataclass(frozen=True, slots=True)
class LeastSquaresFit:
    """What least squares found.

    Attributes:
        pendulum: the torsion.
        second: the second mode (its offset is zero), or None.
        offset: rad/s.
        residual: rad/s, (n,), measured minus fitted.
        period_sigma: s, of the period at zero amplitude, from the covariance of the fit alone.
    """

    pendulum: PendulumSwing
    second: DampedSine | None
    offset: float
    residual: FloatArray
    period_sigma: float

    @property
    def bic(self) -> float:
        """Bayesian information criterion, for comparing fits of one recording."""
        n = len(self.residual)
        parameters = _PENDULUM + 1 + (0 if self.second is None else 4)
        return n * math.log(max(float(np.mean(self.residual**2)), 1e-300)) + parameters * math.log(n)


def fit_law(time: FloatArray, rate: FloatArray, sine: DampedSine) -> LeastSquaresFit:
    """The pendulum law on `rate` (rad/s) at `time` (s from the first sample), started from a damped sine."""
    period = 1.0 / sine.frequency
    early = time <= _FIRST_CYCLES * period
    start = np.array(
        [
            math.tau * sine.frequency,
            min(sine.amplitude / (8.0 * math.tau * sine.frequency), 0.5 * _MAX_ROOT),
            math.atan2(-sine.sine, sine.cosine),
            max(sine.decay, 0.0),
            0.0,
            sine.offset,
        ]
    )
    if np.count_nonzero(~early) > 20 and np.count_nonzero(early) > 40:
        start = _least_squares(time[early], rate[early], start)[0]
    return _result(time, rate, *_least_squares(time, rate, start))


def add_second_mode(time: FloatArray, rate: FloatArray, single: LeastSquaresFit) -> LeastSquaresFit:
    """The pendulum law and a free damped sine, started at the strongest line of what `single` leaves."""
    frequency, _ = strongest_line(time, single.residual)
    turn = math.tau * frequency * time
    columns = np.column_stack([np.cos(turn), np.sin(turn)])
    cosine, sine = np.linalg.lstsq(columns, single.residual, rcond=None)[0]
    p = single.pendulum
    start = np.array(
        [p.omega, p.root, p.phase, p.linear, p.quadratic, single.offset, frequency, 0.0, cosine, sine]
    )
    return _result(time, rate, *_least_squares(time, rate, start))


def _model(p: FloatArray, time: FloatArray) -> FloatArray:
    values = PendulumSwing(*p[:_PENDULUM]).rate(time) + p[5]
    return np.asarray(values + DampedSine(p[6], p[7], p[8], p[9], 0.0).rate(time) if len(p) > 6 else values)


def _least_squares(time: FloatArray, rate: FloatArray, start: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Parameters and their Jacobian."""
    from scipy.optimize import least_squares

    span = float(time[-1])
    size = float(np.sqrt(np.mean(rate**2)))
    lower = np.array([0.5 * start[0], 1e-7, -np.inf, -0.5 / span, 0.0, -np.inf])
    upper = np.array([1.5 * start[0], _MAX_ROOT, np.inf, 60.0 / span, 4000.0 / span, np.inf])
    scale = np.array([0.1 / span, 0.01 * start[1], 0.02, 0.1 / span, 1.0 / span, 0.01 * size])
    if len(start) > len(lower):
        lower = np.concatenate([lower, [0.5 * start[6], -1.0 / span, -np.inf, -np.inf]])
        upper = np.concatenate([upper, [1.5 * start[6], 40.0 / span, np.inf, np.inf]])
        scale = np.concatenate([scale, [0.02 / span, 0.1 / span, 0.01 * size, 0.01 * size]])
    inside = np.clip(start, lower, upper)
    inside[4] = max(inside[4], 1e-6 / span)  # off its bound, where the search would begin without a slope
    found = least_squares(
        lambda p: _model(p, time) - rate,
        inside,
        bounds=(lower, upper),
        x_scale=scale,
        ftol=1e-12,
        xtol=1e-10,
        gtol=1e-12,
        max_nfev=60,
    )
    return np.asarray(found.x), np.asarray(found.jac)


def _result(time: FloatArray, rate: FloatArray, p: FloatArray, jacobian: FloatArray) -> LeastSquaresFit:
    residual = rate - _model(p, time)
    variance = float(np.sum(residual**2)) / max(len(rate) - len(p), 1)
    covariance = variance * np.linalg.pinv(jacobian.T @ jacobian)
    second = DampedSine(p[6], p[7], p[8], p[9], 0.0) if len(p) > 6 else None
    sigma = math.tau / p[0] ** 2 * math.sqrt(max(float(covariance[0, 0]), 0.0))
    return LeastSquaresFit(
        PendulumSwing(*(float(v) for v in p[:_PENDULUM])), second, float(p[5]), residual, sigma
    )
