"""Fit a law to all steps of one direction: its parameters are shared, each step has its own begin and ends.

Residuals are weighted by the instrument's uncertainty and enter with a soft-L1 loss, so that a sample that is
wrong (an edge that was not repaired) does not decide.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from calibration.bench.motors.cluster_covariance import SharedCovariance, shared_covariance
from calibration.bench.motors.errors import TachometerError
from calibration.bench.motors.law import Law
from calibration.bench.motors.records import IntArray
from calibration.bench.motors.steps import SpeedStep
from onboard.arrays import FloatArray

_ROBUST_AT = 2.5
"""Standard deviations beyond which a residual counts less."""
_ROBUST_ROUNDS = 2
"""The first with the instrument's uncertainty as scale, the second with what was left."""
_EARLIEST, _LATEST = 0.12, 0.12
"""s around the onset that was found, in which the true begin is sought."""
_REST = 0.5
"""rad/s: where a fit begins for a rotor that stands."""
_MAD_TO_SIGMA = 1.4826


@dataclass(frozen=True, slots=True)
class _Problem:
    """All samples of the steps in one row, with the index of their step."""

    start: FloatArray
    end: FloatArray
    speed: FloatArray
    sigma: FloatArray
    step_of: IntArray
    slope: FloatArray
    steps: Sequence[SpeedStep]
    law: Law

    @property
    def shared(self) -> int:
        return len(self.law.parameters)

    def residuals(self, parameters: FloatArray) -> FloatArray:
        own = parameters[self.shared :].reshape(3, len(self.steps))[:, self.step_of]
        shared = parameters[: self.shared]
        mean = self.law.mean_speed(self.start, self.end, own[0], own[1], own[2], shared)
        return (mean + self._before_step(own[0]) - self.speed) / self.sigma

    def _before_step(self, begin: FloatArray) -> FloatArray:
        """Mean of what the slope before a step adds to the speed before it."""
        stop = np.minimum(self.end, begin)
        length = np.maximum(stop - self.start, 0.0)
        return self.slope * (0.5 * (self.start + stop) - begin) * length / (self.end - self.start)

    def jacobian(self, parameters: FloatArray) -> FloatArray:
        """By differences; one evaluation for all steps at once, since a sample depends on its step alone."""
        count, steps = self.speed.size, len(self.steps)
        centre = self.residuals(parameters)
        matrix = np.zeros((count, parameters.size))
        for index in range(self.shared):
            delta = 1e-6 * max(abs(parameters[index]), 1e-3 * self.law.high[index])
            moved = parameters.copy()
            moved[index] += delta
            matrix[:, index] = (self.residuals(moved) - centre) / delta
        rows = np.arange(count)
        for kind, delta in enumerate((1e-6, 1e-3, 1e-3)):
            moved = parameters.copy()
            moved[self.shared + kind * steps : self.shared + (kind + 1) * steps] += delta
            matrix[rows, self.shared + kind * steps + self.step_of] = (self.residuals(moved) - centre) / delta
        return matrix

    @property
    def free(self) -> IntArray:
        """Indices of the parameters that are fitted: a rotor that stood has no speed before its step."""
        standing = np.zeros((3, len(self.steps)), dtype=bool)
        standing[1] = [step.standing for step in self.steps]
        return np.flatnonzero(~np.concatenate([np.zeros(self.shared, dtype=bool), standing.ravel()]))


@dataclass(frozen=True, slots=True)
class LawFit:
    """A law fitted to steps of one direction.

    Attributes:
        law: which.
        values: of its shared parameters.
        begins, before, after: (S,) s, rad/s, rad/s of each step.
        residuals: (n,) rad/s, model less measurement.
        step_of: (n,) index of the step of each sample.
        rms: rad/s.
        aic: Akaike's criterion, n ln(mean square) + 2 k with three parameters a step.
        covariance: of the shared parameters.
    """

    law: Law
    values: tuple[float, ...]
    begins: FloatArray
    before: FloatArray
    after: FloatArray
    residuals: FloatArray
    step_of: IntArray
    rms: float
    aic: float
    covariance: SharedCovariance


def fit_law(law: Law, steps: Sequence[SpeedStep]) -> LawFit:
    """Fit `law` to `steps` (of one direction).

    Raises:
        TachometerError: no steps, or fewer samples than parameters.
    """
    from scipy.optimize import least_squares

    problem = _gather(law, steps)
    start, low, high = _start_and_bounds(problem)
    if problem.speed.size <= start.size:
        raise TachometerError(
            f"{len(steps)} steps with {problem.speed.size} samples cannot tell {start.size} parameters: "
            "record longer, or with an instrument that stamps every edge"
        )
    scale, free, parameters = 1.0, problem.free, start.copy()

    def full(chosen: FloatArray) -> FloatArray:
        parameters[free] = chosen
        return parameters

    for _ in range(_ROBUST_ROUNDS):
        solution = least_squares(
            lambda chosen: problem.residuals(full(chosen)),
            start[free],
            lambda chosen: problem.jacobian(full(chosen))[:, free],
            bounds=(low[free], high[free]),
            loss="soft_l1",
            f_scale=_ROBUST_AT * scale,
            x_scale="jac",
            xtol=1e-8,
            ftol=1e-8,
            gtol=1e-8,
        )
        start = np.clip(full(solution.x), low + 1e-12, high - 1e-12)
        spread = _MAD_TO_SIGMA * float(np.median(np.abs(solution.fun)))
        scale = max(spread, 1e-6)
    return _result(problem, full(solution.x), scale)


def _gather(law: Law, steps: Sequence[SpeedStep]) -> _Problem:
    if not steps:
        raise TachometerError("no step of this direction was found: record steps up and down, 1.5 s each")

    def row(name: str) -> FloatArray:
        return np.concatenate([getattr(step.trace, name)[step.first : step.last] for step in steps])

    step_of = np.repeat(np.arange(len(steps)), [step.last - step.first for step in steps])
    slope = np.array([step.slope for step in steps])[step_of]
    return _Problem(row("start"), row("end"), row("speed"), row("sigma"), step_of, slope, steps, law)


def _start_and_bounds(problem: _Problem) -> tuple[FloatArray, FloatArray, FloatArray]:
    steps, law = problem.steps, problem.law
    onset = np.array([step.onset for step in steps])
    before = np.array([step.before for step in steps])
    after = np.array([max(step.after, _REST) for step in steps])
    early = np.array([_EARLIEST + step.trace.resolution for step in steps])
    late = np.array([_LATEST + step.trace.resolution for step in steps])
    most = 1.3 * max(float(np.max(problem.speed)), 1.0)
    start = np.concatenate([law.start, onset, np.maximum(before, _REST), after])
    low = np.concatenate([law.low, onset - early, np.zeros(2 * len(steps))])
    high = np.concatenate([law.high, onset + late, np.full(2 * len(steps), most)])
    standing = problem.shared + len(steps) + np.flatnonzero([step.standing for step in steps])
    start[standing] = 0.0
    return start, low, high


def _result(problem: _Problem, parameters: FloatArray, scale: float) -> LawFit:
    shared, count = problem.shared, len(problem.steps)
    weighted = problem.residuals(parameters)
    weight = (1.0 + (weighted / (_ROBUST_AT * scale)) ** 2) ** -0.25  # square root of soft-L1's weight
    jacobian = problem.jacobian(parameters)
    covariance = shared_covariance(
        jacobian[:, problem.free] * weight[:, None], weighted * weight, problem.step_of, shared
    )
    residuals = weighted * problem.sigma
    mean_square = float(np.mean(residuals**2))
    own = parameters[shared:].reshape(3, count)
    return LawFit(
        law=problem.law,
        values=tuple(float(value) for value in parameters[:shared]),
        begins=own[0],
        before=own[1],
        after=own[2],
        residuals=residuals,
        step_of=problem.step_of,
        rms=math.sqrt(mean_square),
        aic=residuals.size * math.log(mean_square) + 2.0 * (shared + 3 * count),
        covariance=covariance,
    )
