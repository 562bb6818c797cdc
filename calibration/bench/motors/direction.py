"""The speed law of one direction, with what follows from it and how sure it is."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from calibration.bench.motors.cluster_covariance import SharedCovariance
from calibration.bench.motors.fit import LawFit, fit_law
from calibration.bench.motors.law import DRAG_ONLY, LAWS, SPEED_LAW, riccati_speed
from calibration.bench.motors.settling import first_order_constant, local_constant, time_to_share
from calibration.bench.motors.steps import Direction, SpeedStep
from calibration.measurement import Estimate
from onboard.arrays import FloatArray

LOW_RESOLUTION_SHARE = 0.04
"""Relative standard uncertainty of times that window averages add (bench notes, acceptance 8: within 8 %)."""


@dataclass(frozen=True, slots=True)
class ModelScore:
    """A law among those that were compared.

    Attributes:
        name, equation: of the law.
        values: parameters by name, in SI units.
        rms: rad/s.
        aic: Akaike's criterion; the lowest describes the steps best.
    """

    name: str
    equation: str
    values: dict[str, float]
    rms: float
    aic: float


@dataclass(frozen=True, slots=True)
class DirectionFit:
    """The speed law dw/dt = a (ws - w) + b (ws^2 - w^2) of one direction.

    Attributes:
        direction: up or down.
        a: 1/s; 0 where the data would have it negative.
        b: 1/rad.
        fit: of the law, with residuals and each step's begin and ends.
        steps: that it was fitted to.
        alternatives: all laws, best first.
        covariance: of (a, b), or of b alone where a is 0 by its bound.
        relative_floor: standard uncertainty that every time has on top, relative (clock, window averages).
    """

    direction: Direction
    a: Estimate
    b: Estimate
    fit: LawFit
    steps: tuple[SpeedStep, ...]
    alternatives: tuple[ModelScore, ...]
    covariance: SharedCovariance
    relative_floor: float

    @property
    def a_at_bound(self) -> bool:
        """Whether a was set to 0 because the data would have it negative."""
        return self.fit.law is DRAG_ONLY

    def time_63(self, start: float, end: float) -> Estimate:
        """63 % time (s) of a step of thrust between two speeds (rad/s)."""
        return self.derived(lambda a, b: time_to_share(start, end, a, b))

    def first_order(self, start: float, end: float) -> Estimate:
        """Constant (s) of the first-order thrust that follows a step between two speeds (rad/s) best."""
        return self.derived(lambda a, b: first_order_constant(start, end, a, b))

    def local(self, speed: float) -> Estimate:
        """Time constant (s) of small changes about a speed (rad/s)."""
        return self.derived(lambda a, b: local_constant(speed, a, b))

    def derived(self, quantity: Callable[[float, float], float]) -> Estimate:
        """A time (s) that follows from (a, b), with its uncertainty."""
        a, b = self.a.value, self.b.value
        value = quantity(a, b)
        step_a, step_b = 1e-4 * max(a, 1.0), 1e-4 * b
        by_b = (quantity(a, b + step_b) - quantity(a, b - step_b)) / (2.0 * step_b)
        gradient = np.array([by_b])
        if not self.a_at_bound:
            by_a = (quantity(a + step_a, b) - value) / step_a
            gradient = np.array([by_a, by_b])
        sigma, dof = self.covariance.of(gradient)
        return Estimate(value, "s", math.hypot(sigma, self.relative_floor * abs(value)), dof)


def fit_direction(steps: Sequence[SpeedStep], clock_sigma: float) -> DirectionFit:
    """Fit the speed law, and the laws it is compared with, to all steps of one direction.

    Args:
        steps: of one direction.
        clock_sigma: relative standard uncertainty of the instrument's clock.

    Raises:
        TachometerError: no steps, or too few samples.
    """
    fits = {law.name: fit_law(law, steps) for law in LAWS}
    scores = {name: _score(fit) for name, fit in fits.items()}
    free = fits[SPEED_LAW.name]
    sigma_a, dof_a = free.covariance.of(np.array([1.0, 0.0]))
    if free.values[0] < 0.0:
        chosen = fits[DRAG_ONLY.name]
        a, b = 0.0, chosen.values[0]
        scores[SPEED_LAW.name] = _bounded_score(chosen)
        sigma_b, dof_b = chosen.covariance.of(np.array([1.0]))
    else:
        chosen = free
        a, b = free.values
        sigma_b, dof_b = free.covariance.of(np.array([0.0, 1.0]))
    coarse = any(is_low_resolution(step, a, b) for step in steps)
    return DirectionFit(
        direction=steps[0].direction,
        a=Estimate(a, "1/s", math.hypot(sigma_a, clock_sigma * a), dof_a),
        b=Estimate(b, "1/rad", sigma_b, dof_b),
        fit=chosen,
        steps=tuple(steps),
        alternatives=tuple(sorted(scores.values(), key=lambda one: one.aic)),
        covariance=chosen.covariance,
        relative_floor=math.hypot(clock_sigma, LOW_RESOLUTION_SHARE if coarse else 0.0),
    )


def is_low_resolution(step: SpeedStep, a: float, b: float) -> bool:
    """Whether the instrument averages over more than a third of the time constant (bench notes 1.2)."""
    fastest = max(step.before, step.after)
    return step.trace.resolution > local_constant(max(fastest, 1.0), max(a, 0.0), b) / 3.0


def _score(fit: LawFit) -> ModelScore:
    values = dict(zip(fit.law.parameters, fit.values, strict=True))
    return ModelScore(fit.law.name, fit.law.equation, values, fit.rms, fit.aic)


def _bounded_score(fit: LawFit) -> ModelScore:
    """The speed law with a at its bound 0: the drag alone, at the price of one more parameter."""
    values = {"a": 0.0, "b": fit.values[0]}
    return ModelScore(SPEED_LAW.name, SPEED_LAW.equation, values, fit.rms, fit.aic + 2.0)


def predicted(fit: LawFit, step: int, t: FloatArray, a: float, b: float) -> FloatArray:
    """Speed (rad/s) of the fitted law at times `t` (s) of one of its steps."""
    shape = np.ones(t.size)
    return riccati_speed(t - fit.begins[step], fit.before[step] * shape, fit.after[step] * shape, a, b)
