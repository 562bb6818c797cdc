"""What a vehicle would show in a landing: the observables of simulated landings from uncertain starts."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from calibration.gap.landing.kernels import (
    COLUMNS,
    DT,
    FEET,
    NUISANCES,
    OMEGA,
    POSITION,
    QUATERNION,
    VELOCITY,
    displace,
    fly,
    gyro_residuals,
)
from calibration.gap.landing.observation import Observation, observe
from calibration.gap.landing.problem import Problem
from onboard.arrays import FloatArray
from sim_backend.physics.parameters import parameter_batch

SAMPLES = 12
"""Start states that a prediction is spread over."""

LENGTH = 1.3
"""s of a prediction after the contact."""

_LOG_STEPS = 10  # 100 Hz, as our own runs are logged
_APPROACH_ROWS = 6


@dataclass(frozen=True)
class Prediction:
    """Observables over the start states.

    Attributes:
        seen: what each sample shows. feet: that hold at the end, (samples,).
    """

    seen: tuple[Observation, ...]
    feet: FloatArray


def predict(problem: Problem, parameters: Any, rng: np.random.Generator) -> Prediction:
    """Land from SAMPLES start states, drawn from the prior of the measurement."""
    seen, feet = [], []
    for x in rng.standard_normal((SAMPLES, NUISANCES)):
        trace = landing_trace(problem, parameters, x, LENGTH)
        rows = _with_approach(trace[::_LOG_STEPS])
        at = DT * _LOG_STEPS * (np.arange(len(rows)) - _APPROACH_ROWS)
        t = np.asarray(problem.start.t + at, dtype=np.float64)
        pose = rows[:, QUATERNION : POSITION + 3]
        rates = np.clip(rows[:, OMEGA : OMEGA + 3], -problem.limit, problem.limit)
        segment = problem.segment
        seen.append(observe(t, rates, t, pose, segment.before, segment.after, True))
        feet.append(trace[-1, FEET])
    return Prediction(tuple(seen), np.array(feet))


def _with_approach(rows: FloatArray) -> FloatArray:
    """Rows of a trace with straight flight in front, from which the velocity before the contact is read."""
    before = np.repeat(rows[:1], _APPROACH_ROWS, axis=0)
    back = DT * _LOG_STEPS * np.arange(-_APPROACH_ROWS, 0)[:, None]
    before[:, POSITION : POSITION + 3] += back * rows[0, VELOCITY : VELOCITY + 3]
    return np.vstack([before, rows])


def landing_trace(problem: Problem, parameters: Any, x: FloatArray, length: float) -> FloatArray:
    """Trace (steps + 1, COLUMNS) of a landing with the nuisances x, for `length` (s) after the contact."""
    steps = round((problem.segment.after - problem.start.t + length) / DT)
    targets = problem.targets[np.minimum(np.arange(steps), len(problem.targets) - 1)]
    state = problem.start.state.copy()
    batch = parameter_batch(parameters, 1)
    batch["ceiling_z"] = problem.ceiling
    displace(state[0], batch[0], x, problem.start.sigma)
    trace = np.empty((steps + 1, COLUMNS))
    fly(state[0], batch[0], np.ascontiguousarray(targets), 1, trace)
    return trace


def rate_error(problem: Problem, parameters: Any, x: FloatArray, horizon: float) -> float:
    """RMS (rad/s) of gyro minus prediction, all axes, within `horizon` (s) after the contact."""
    trace = landing_trace(problem, parameters, x, horizon + 0.02)
    contact = problem.segment.after - problem.start.t
    rows = (problem.gyro[:, 0] >= contact) & (problem.gyro[:, 0] <= contact + horizon)
    gyro = np.ascontiguousarray(problem.gyro[rows])
    out = np.empty((len(gyro), 3))
    weight = np.ones((len(gyro), 3))
    gyro_residuals(trace, gyro, weight, float(x[10] * problem.start.sigma[10]), problem.limit, out)
    return float(np.sqrt(np.mean(out**2)))
