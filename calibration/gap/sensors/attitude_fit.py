"""Tracked attitude against the gyro: delay of the pose, turn of the tracked frame, bias of the gyro.

No model of the vehicle is needed: both watch one rigid body. All unknowns, the delay being a path along the
flight, come from linear least squares about the last round's result (Gauss-Newton). The spreads of noise,
random walk of the gyro and wander of the delay are those of largest marginal likelihood: a flight that
hardly turns, or a clock that is good, falls back to one constant delay.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from calibration.gap.data.record import FlightRecord
from calibration.gap.sensors.attitude_equations import (
    AttitudeEquations,
    LinearisationPoint,
    Solution,
    delay_knots,
    first_state,
)
from calibration.gap.sensors.first_path import FirstPath
from calibration.gap.sensors.knots import hats
from onboard.arrays import FloatArray

_NOISES = (1.0, 2.0, 4.0, 8.0, 16.0)  # of what changes from sample to sample: some of it changes slowly
_WALKS = (3e-4, 1e-3, 3e-3, 1e-2, 3e-2, 1e-1)  # rad per root s
_WANDERS = (1e-5, 3e-3, 1e-2, 3e-2)  # s; the first is as good as none
_ROUNDS = 3


@dataclass(frozen=True)
class AttitudeFit:
    """What tracked attitude and gyro of one flight say of each other.

    Attributes:
        knots: times (s), shape (k,).
        path: s, delay of the pose at the knots, shape (k,); positive: the pose is late.
        delay, delay_error: mean over the flight (s) and its standard error.
        wander: s, standard deviation of the path about its level.
        rotation, rotation_covariance: rad, shape (3,) and (3, 3).
        bias, bias_covariance: rad/s, shape (3,) and (3, 3).
        attitude: by gyro and tracking together, body to world, on the onboard clock, shape (n, 4).
    """

    knots: FloatArray
    path: FloatArray
    delay: float
    delay_error: float
    wander: float
    rotation: FloatArray
    rotation_covariance: FloatArray
    bias: FloatArray
    bias_covariance: FloatArray
    attitude: FloatArray


def fit_attitude(record: FlightRecord, start: FirstPath) -> AttitudeFit:
    """Fit one flight, starting from the rough path `start`."""
    used = record.inertial_known & (record.flying | record.resting)
    knots = delay_knots(record)
    path = np.interp(knots, start.t, start.delay)
    state = first_state(record, path, noise=3e-3, walk=_WALKS[1], wander=_WANDERS[2])
    for _ in range(_ROUNDS):
        equations = AttitudeEquations(record, used, state)
        least = equations.quick_noise()
        state = _likeliest(equations, [replace(state, noise=least * factor) for factor in _NOISES]).at
        state = _likeliest(equations, [replace(state, walk=walk) for walk in _WALKS]).at
        solution = _likeliest(equations, [replace(state, wander=wander) for wander in _WANDERS])
        state = equations.moved(solution)
    covariance = equations.covariance(solution)
    k = knots.size
    mean = np.asarray(hats(record.t, knots)[record.flying].mean(axis=0)).ravel()
    return AttitudeFit(
        knots=knots,
        path=state.path,
        delay=float(mean @ state.path),
        delay_error=float(np.sqrt(mean @ covariance[:k, :k] @ mean)),
        wander=state.wander,
        rotation=state.rotation,
        rotation_covariance=covariance[k : k + 3, k : k + 3],
        bias=state.bias,
        bias_covariance=covariance[k + 3 :, k + 3 :],
        attitude=equations.attitude(solution),
    )


def _likeliest(equations: AttitudeEquations, states: Sequence[LinearisationPoint]) -> Solution:
    return max((equations.solve(state) for state in states), key=lambda solution: solution.likelihood)
