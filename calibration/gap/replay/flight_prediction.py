"""Predict one flight with one model, from many starts."""

from typing import Any

import numpy as np

from calibration.gap.replay.inputs import PredictionInputs, motor_starts
from calibration.gap.replay.kernels import TRIMS, predict
from calibration.gap.replay.window_errors import WindowErrors, window_errors
from calibration.gap.replay.windows import Rows
from onboard.arrays import FloatArray


def predicted_states(
    inputs: PredictionInputs,
    rows: Rows,
    ends: Rows,
    lengths: Rows,
    *,
    given_attitude: bool,
    parameters: Any = None,
    trims: FloatArray | None = None,
    velocity: FloatArray | None = None,
) -> FloatArray:
    """States of the model at the horizons after each start.

    Args:
        inputs: the flight.
        rows: starts, increasing, shape (m,).
        ends: samples of the horizons, increasing, shape (h,).
        lengths: samples that may be predicted from each start, shape (m,).
        given_attitude: attitude and rate are the measured ones.
        parameters: of the physics; default: those of the inputs.
        trims: of each start, shape (m, 5) or (5,), see :data:`~calibration.gap.replay.kernels.Trim`.
        velocity: m/s, shape (m, 3), to start with; default: that from the past alone.

    Returns:
        Position, velocity, quaternion, rate: shape (m, h, 13), NaN beyond the length of a start.
    """
    p = inputs.parameters if parameters is None else parameters
    starts, _ = motor_starts(inputs, p, rows)
    if velocity is not None:
        starts["velocity"] = velocity
    every = np.zeros((rows.size, TRIMS))
    if trims is not None:
        every[:] = trims
    out = np.full((rows.size, ends.size, 13), np.nan)
    predict(
        starts, rows, np.minimum(lengths, ends[-1]), ends, every, p, inputs.duty, inputs.voltage,
        inputs.quaternion, inputs.rate, given_attitude, inputs.substeps, inputs.step, out,
    )  # fmt: skip
    return out


def prediction_errors(
    inputs: PredictionInputs,
    rows: Rows,
    ends: Rows,
    lengths: Rows,
    *,
    given_attitude: bool,
    parameters: Any = None,
    trims: FloatArray | None = None,
    velocity: FloatArray | None = None,
) -> WindowErrors:
    """Errors of :func:`predicted_states` against the measurements; the same arguments."""
    states = predicted_states(
        inputs, rows, ends, lengths,
        given_attitude=given_attitude, parameters=parameters, trims=trims, velocity=velocity,
    )  # fmt: skip
    return window_errors(inputs, rows, ends, lengths, states, given_attitude)
