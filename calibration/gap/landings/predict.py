"""A landing as a vehicle would fly it, and how far its rates are off the gyro's."""

from typing import Any

import numpy as np

from calibration.gap.landings.kernels import COLUMNS, DT, displace, fly, gyro_residuals
from calibration.gap.landings.problem import Problem
from onboard.arrays import FloatArray
from sim_backend.physics.parameters import parameter_batch

EARLY = 0.3
"""s after the contact in which the rates are compared."""


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
