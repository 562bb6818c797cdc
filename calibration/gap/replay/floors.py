"""What no model can beat on these data: the inertial sensors in place of the model.

The accelerometer integrated along the measured attitude is the floor of predictions with given attitude; gyro
and accelerometer alone are that of open-loop predictions. Both start from the same states as the models, so
what is left is noise of start, reference and sensors.
"""

import numpy as np

from calibration.gap.data.rotations import integrate_rate
from calibration.gap.replay.flight_prediction import Replay, WindowErrors, in_body_axes, rotation_between
from calibration.gap.replay.inputs import PredictionInputs, twice_integrated
from calibration.gap.replay.kernels import TRIMS
from calibration.gap.replay.windows import Rows
from onboard.arrays import FloatArray
from onboard.rotation import to_matrices

NO_TRIM = np.zeros(TRIMS)


def accelerometer_bias(inputs: PredictionInputs, rows: Rows, end: int) -> FloatArray:
    """Bias (m/s2, body) of the accelerometer against position and attitude, from the mean velocity error.

    To the sensors it is what scale and lean are to a model: where those are fitted to a flight's first
    seconds, so is this.

    Args:
        rows: starts that reach the horizon, shape (m,). end: samples of the horizon.
    """
    ends, lengths = np.array([end]), np.full(rows.size, end)
    replay = Replay(rows=rows, ends=ends, lengths=lengths, parameters=inputs.parameters, trims=NO_TRIM)
    errors = accelerometer_driven(inputs, replay, np.zeros(3))
    bias: FloatArray = in_body_axes(errors, inputs.rotation[rows])[:, 0, 1].mean(axis=0) / (end * inputs.dt)
    return bias


def accelerometer_driven(inputs: PredictionInputs, replay: Replay, bias: FloatArray) -> WindowErrors:
    """Errors of the measured specific force integrated with the measured attitude.

    `bias` (m/s2, body) is that of the accelerometer.
    """
    same = np.broadcast_to(np.eye(3), (replay.rows.size, 3, 3))
    vectors = _translation(inputs, inputs.rotation, same, replay, bias)
    vectors[~replay.reached] = np.nan
    return WindowErrors(replay.rows, vectors, replay.reached)


def gyro_driven(inputs: PredictionInputs, replay: Replay, bias: FloatArray) -> WindowErrors:
    """As :func:`accelerometer_driven`, with the attitude from the gyro; the rate itself has no floor."""
    rows, ends = replay.rows, replay.ends
    turned = integrate_rate(np.nan_to_num(inputs.rate), inputs.dt)
    # One path of the gyro through the flight serves all starts: C turns it into the world of a start.
    rotation = to_matrices(turned)
    into_world = inputs.rotation[rows] @ rotation[rows].transpose(0, 2, 1)
    vectors = _translation(inputs, rotation, into_world, replay, bias)
    at = np.minimum(rows[:, None] + ends[None, :], turned.shape[0] - 1)
    start = rotation_between(turned[rows][:, None], turned[at])
    measured = rotation_between(inputs.quaternion[rows][:, None], inputs.quaternion[at])
    vectors[:, :, 2] = rotation_between(_exponential(measured), _exponential(start))
    vectors[~replay.reached] = np.nan
    return WindowErrors(rows, vectors, replay.reached)


def _translation(
    inputs: PredictionInputs, rotation: FloatArray, into_world: FloatArray, replay: Replay, bias: FloatArray
) -> FloatArray:
    """Errors with position and velocity of the integrated specific force alone, shape (m, h, 4, 3)."""
    rows, ends = replay.rows, replay.ends
    vectors = np.full((rows.size, ends.size, 4, 3), np.nan)
    force = inputs.record.specific_force
    if force is None:
        raise ValueError("a floor needs an accelerometer")
    faster, further = twice_integrated((rotation @ (force - bias)[:, :, None])[:, :, 0], inputs.dt)
    gravity = np.array([0.0, 0.0, -float(inputs.parameters["gravity"])])
    at = np.minimum(rows[:, None] + ends[None, :], inputs.position.shape[0] - 1)
    time = (inputs.dt * ends)[None, :, None]
    gained = faster[at] - faster[rows][:, None]
    moved = further[at] - further[rows][:, None] - time * faster[rows][:, None]
    gained = np.einsum("mij,mhj->mhi", into_world, gained) + time * gravity
    moved = np.einsum("mij,mhj->mhi", into_world, moved) + 0.5 * time**2 * gravity
    # What an accelerometer feels is the motion of its board.
    position, velocity = inputs.position + inputs.board, inputs.velocity + inputs.board_swing
    start_v = (inputs.start_velocity + inputs.board_swing)[rows][:, None]
    vectors[:, :, 1] = start_v + gained - velocity[at]
    vectors[:, :, 0] = position[rows][:, None] + time * start_v + moved - position[at]
    return vectors


def _exponential(vector: FloatArray) -> FloatArray:
    """Quaternions, shape (..., 4), of rotation vectors (rad)."""
    half = 0.5 * np.linalg.norm(vector, axis=-1, keepdims=True)
    return np.concatenate([0.5 * np.sinc(half / np.pi) * vector, np.cos(half)], axis=-1)
