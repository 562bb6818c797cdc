"""Attitude and rate a tenth of a second ahead, with the disturbance torque of the last moments taken along.

Rotation by open-loop replay is no fair target: the logged commands contain the controller's answer to
disturbances that a replay never sees (gap note, 2). With the mean unexplained angular acceleration of the
last 0.2 s held constant, the error falls with every right effect.
"""

from dataclasses import replace

import numpy as np

from calibration.gap.replay.flight_prediction import WindowErrors, predicted_states, prediction_errors
from calibration.gap.replay.inputs import PredictionInputs
from calibration.gap.replay.nuisances import Nuisances
from calibration.gap.replay.windows import Rows
from onboard.arrays import FloatArray

HORIZON = 0.1
MEMORY = 0.2
"""s."""


def unexplained_acceleration(inputs: PredictionInputs, nuisances: Nuisances) -> FloatArray:
    """Measured minus modelled angular acceleration (rad/s2, body), mean over each sample interval.

    Returns:
        shape (n - 1, 3): between each sample and the next, from the measured state at the first of both. NaN
        where that state or the next rate is not known.
    """
    rows = np.arange(inputs.duty.shape[0] - 1)
    next_sample = nuisances.replay(inputs, rows, np.array([1]), np.ones(rows.size, dtype=np.int64))
    following = predicted_states(inputs, replace(next_sample, velocity=inputs.velocity[rows]))
    acceleration = (inputs.rate[1:] - following[:, 0, 10:13]) / inputs.dt
    acceleration[~(inputs.known[:-1] & inputs.known[1:])] = np.nan
    return acceleration


def with_torque_estimate(
    inputs: PredictionInputs, rows: Rows, lengths: Rows, nuisances: Nuisances
) -> WindowErrors:
    """Errors at :data:`HORIZON` with the mean of the unexplained acceleration over the last :data:`MEMORY`.

    Starts without a complete memory, or that do not reach the horizon, are left out.
    """
    end = np.array([max(1, inputs.rows(HORIZON))])
    memory = max(1, inputs.rows(MEMORY))
    acceleration = unexplained_acceleration(inputs, nuisances)
    total = np.vstack([np.zeros(3), np.cumsum(np.nan_to_num(acceleration), axis=0)])
    unknown = np.concatenate([[0], np.cumsum(np.isnan(acceleration).any(axis=1))])
    rows, lengths = rows[rows >= memory], lengths[rows >= memory]
    usable = (unknown[rows] == unknown[rows - memory]) & (lengths >= end[0])
    rows, lengths = rows[usable], lengths[usable]
    trims = np.tile(nuisances.trim(), (rows.size, 1))
    trims[:, 2:] += (total[rows] - total[rows - memory]) / memory
    return prediction_errors(inputs, replace(nuisances.replay(inputs, rows, end, lengths), trims=trims))
