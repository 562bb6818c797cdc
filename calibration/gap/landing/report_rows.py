"""The rows of the report: what each landing shows, and what the vehicle shows before and after."""

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from calibration.gap.landing.findings import LandingResidual, Residual
from calibration.gap.landing.observation import EARLY, Observation
from calibration.gap.landing.predict import Prediction, predict, rate_error
from calibration.gap.landing.problem import Problem
from calibration.gap.landing.search import NOMINAL, Table, Theta, apply

Reading = Callable[[Observation], float | None]

READINGS: dict[str, Reading] = {
    "peak_rate": lambda seen: seen.peak_rate,
    "rebound_rate": lambda seen: seen.rebound_rate,
    "impulse": lambda seen: None if seen.impulse is None else float(seen.impulse[2]),
    "swing_period": lambda seen: None if seen.swing is None else seen.swing.period,
    "swing_decay": lambda seen: None if seen.swing is None else seen.swing.decay,
}


def landing_residuals(
    table: Table, theta: Theta | None, rng: np.random.Generator
) -> tuple[LandingResidual, ...]:
    """Of every landing; `theta`: what was found, or None."""
    return tuple(
        _row(table, index, problem, theta, rng) for index, problem in enumerate(table.solver.problems)
    )


def _row(
    table: Table, index: int, problem: Problem, theta: Theta | None, rng: np.random.Generator
) -> LandingResidual:
    before = apply(table.parameters, NOMINAL)
    predicted = predict(problem, before, rng)
    after = None if theta is None else apply(table.parameters, theta)
    improved = None if after is None else predict(problem, after, rng)
    seen = problem.segment.observed
    rows = {
        name: Residual(reading(seen), _spread(predicted, reading), _spread(improved, reading))
        for name, reading in READINGS.items()
    }
    return LandingResidual(
        name=problem.segment.name,
        rate_error_before=_error(table, problem, index, before, NOMINAL),
        rate_error_after=None if theta is None else _error(table, problem, index, after, theta),
        misfit_before=float(table.ratios[NOMINAL][index]),
        misfit_after=None if theta is None else float(table.ratios[theta][index]),
        feet=Residual(None, _feet(predicted), None if improved is None else _feet(improved)),
        **rows,
    )


def _error(table: Table, problem: Problem, index: int, parameters: Any, theta: Theta) -> float:
    return rate_error(problem, parameters, table.starts[theta][index], EARLY)


def _feet(prediction: Prediction) -> tuple[float, float]:
    return float(np.median(prediction.feet)), float(np.std(prediction.feet))


def _spread(prediction: Prediction | None, reading: Reading) -> tuple[float, float] | None:
    """Median and standard deviation over the samples that show it."""
    if prediction is None:
        return None
    values = [value for value in map(reading, prediction.seen) if value is not None and math.isfinite(value)]
    return (float(np.median(values)), float(np.std(values))) if values else None
