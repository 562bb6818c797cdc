"""Predict one flight with one model from many starts; its errors, and means over any choice of starts."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from calibration.gap.replay.inputs import PredictionInputs, motor_starts
from calibration.gap.replay.kernels import TRIMS, predict
from calibration.gap.replay.windows import Rows
from onboard.arrays import BoolArray, FloatArray

QUANTITIES = ("position_m", "velocity_m_s", "attitude_deg", "rate_rad_s")
"""Quantities of a prediction, with unit, in the order of :attr:`WindowErrors.vectors`."""

SCALES = (1.0, 1.0, float(np.degrees(1.0)), 1.0)
"""From SI to the unit in the name."""


@dataclass(frozen=True)
class WindowErrors:
    """Errors of one way of predicting one flight.

    Attributes:
        rows: sample of each start, shape (m,).
        vectors: shape (m, horizons, 4, 3), predicted minus measured, SI, each as :data:`QUANTITIES`: position
            and velocity in the world, attitude as the rotation vector from measured to predicted (rad, body),
            rate in the body. NaN where the flight ends before the horizon, or where the quantity was given;
            not finite where the model ran away.
        reached: which start reaches which horizon, shape (m, horizons).
    """

    rows: Rows
    vectors: FloatArray
    reached: BoolArray

    def norms(self) -> FloatArray:
        """Length of each error vector in the unit of its name, shape (m, horizons, 4)."""
        with np.errstate(over="ignore"):  # a model that ran away is not finite, and counted as such
            return np.linalg.norm(self.vectors, axis=3) * SCALES


def rotation_between(a: FloatArray, b: FloatArray) -> FloatArray:
    """Rotation vectors (rad) that take attitude `a` to attitude `b` in the frame of `a`; shapes (..., 4)."""
    va, wa, vb, wb = a[..., :3], a[..., 3:], b[..., :3], b[..., 3:]
    with np.errstate(over="ignore", invalid="ignore"):
        vector = wa * vb - wb * va - np.cross(va, vb)
        scalar = wa * wb + np.sum(va * vb, axis=-1, keepdims=True)
    vector = np.where(scalar < 0.0, -vector, vector)
    sine = np.linalg.norm(vector, axis=-1, keepdims=True)
    angle = 2.0 * np.arctan2(sine, np.abs(scalar))
    # angle / sin(angle / 2) -> 2 for small angles
    factor = np.where(sine > 1e-12, angle / np.maximum(sine, 1e-12), 2.0)
    return vector * factor


@dataclass(frozen=True, kw_only=True)
class HorizonErrors:
    """Mean error norms at one horizon; None for what was given to the prediction, or is not measured.

    Attributes:
        position_m, velocity_m_s, attitude_deg, rate_rad_s: means; the attitude is the geodesic angle.
        windows: starts that reach the horizon.
        diverged: of these, starts from which the model ran away to no number at all; not in the means.
    """

    position_m: float | None
    velocity_m_s: float | None
    attitude_deg: float | None
    rate_rad_s: float | None
    windows: int
    diverged: int = 0

    def json_shape(self) -> dict[str, Any]:
        """The errors that there are, and the number of windows."""
        found = {name: getattr(self, name) for name in QUANTITIES if getattr(self, name) is not None}
        counts = {"windows": self.windows, **({"diverged": self.diverged} if self.diverged else {})}
        return {**found, **counts}


ByHorizon = dict[float, HorizonErrors]
"""Errors by horizon (s)."""


def mean_by_horizon(norms: FloatArray, reached: BoolArray, horizons: tuple[float, ...]) -> ByHorizon:
    """Means over the starts, at every horizon that any start reaches.

    Args:
        norms: shape (m, h, 4), see :meth:`WindowErrors.norms`.
        reached: which start reaches which horizon, shape (m, h).
        horizons: s, shape (h,).
    """
    means: ByHorizon = {}
    for index, horizon in enumerate(horizons):
        scored = norms[reached[:, index], index]
        if scored.shape[0] == 0:
            continue
        finite = scored[np.isfinite(scored[:, 0])]
        values = finite.mean(axis=0) if finite.shape[0] else np.full(len(QUANTITIES), np.nan)
        numbers = [float(v) if np.isfinite(v) else None for v in values]
        means[horizon] = HorizonErrors(
            **dict(zip(QUANTITIES, numbers, strict=True)),
            windows=scored.shape[0],
            diverged=scored.shape[0] - finite.shape[0],
        )
    return means


def in_body_axes(errors: WindowErrors, rotation: FloatArray) -> FloatArray:
    """The error vectors with position and velocity along the body axes of the start, shape (m, h, 4, 3)."""
    vectors = errors.vectors.copy()
    vectors[:, :, :2] = np.einsum("mji,mhqj->mhqi", rotation, vectors[:, :, :2])
    return vectors


@dataclass(frozen=True, kw_only=True)
class Replay:
    """What is predicted of a flight, with which numbers.

    Attributes:
        rows: starts, increasing, shape (m,).
        ends: samples of the horizons, increasing, shape (h,).
        lengths: samples that may be predicted from each start, shape (m,).
        trims: of each start, shape (m, 5) or (5,), see :data:`~calibration.gap.replay.kernels.Trim`.
        given_attitude: attitude and rate are the measured ones.
        velocity: m/s, shape (m, 3), to start with; default: that from the past alone.
    """

    rows: Rows
    ends: Rows
    lengths: Rows
    parameters: Any
    trims: FloatArray
    given_attitude: bool = False
    velocity: FloatArray | None = None

    @property
    def reached(self) -> BoolArray:
        """Which start reaches which horizon, shape (m, h)."""
        return self.ends[None, :] <= self.lengths[:, None]


def predicted_states(inputs: PredictionInputs, replay: Replay) -> FloatArray:
    """States of the model at the horizons after each start of a flight.

    Returns:
        Position, velocity, quaternion, rate: shape (m, h, 13), NaN beyond the length of a start.
    """
    rows, ends, p = replay.rows, replay.ends, replay.parameters
    starts, _ = motor_starts(inputs, p, rows)
    if replay.velocity is not None:
        starts["velocity"] = replay.velocity
    every = np.zeros((rows.size, TRIMS))
    every[:] = replay.trims
    out = np.full((rows.size, ends.size, 13), np.nan)
    predict(
        starts, rows, np.minimum(replay.lengths, ends[-1]), ends, every, p, inputs.duty, inputs.voltage,
        inputs.quaternion, inputs.rate, replay.given_attitude, inputs.substeps, inputs.step, out,
    )  # fmt: skip
    return out


def prediction_errors(inputs: PredictionInputs, replay: Replay) -> WindowErrors:
    """Errors of :func:`predicted_states` against the measurements."""
    rows, ends = replay.rows, replay.ends
    states = predicted_states(inputs, replay)
    at = np.minimum(rows[:, None] + ends[None, :], inputs.position.shape[0] - 1)
    vectors = np.full((rows.size, ends.size, 4, 3), np.nan)
    vectors[:, :, 0] = states[:, :, 0:3] - inputs.position[at]
    vectors[:, :, 1] = states[:, :, 3:6] - inputs.velocity[at]
    if not replay.given_attitude:
        vectors[:, :, 2] = rotation_between(inputs.quaternion[at], states[:, :, 6:10])
        vectors[:, :, 3] = states[:, :, 10:13] - inputs.rate[at]
    return WindowErrors(rows, vectors, replay.reached)
