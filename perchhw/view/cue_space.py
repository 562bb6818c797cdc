"""The optical-flow space: where the policy fires, and the state that moves towards it.

The axes are tau (s), theta_x (1/s) and d_ceil (m), each scaled to a box of one unit, for their numbers are of
different sizes. The region in which the trigger fires is drawn by its two faces: the largest tau at which it
fires, which an approach meets first, and the smallest. A state outside the box is shown at its edge.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from onboard.arrays import FloatArray
from onboard.policy.model import Policy
from onboard.policy.trigger import trigger_values
from onboard.record.run_record import RunRecord
from perchhw.record.palette import BLUE, GREY, ORANGE, SKY, VERMILION
from perchhw.view.plots import knows_ceiling
from perchhw.view.timeline import Canvas

ENTITY = "cue_space"
AXES = ("tau", "theta_x", "d_ceil")
_UNITS = ("s", "1/s", "m")
_TICKS = 5
_TAU_SAMPLES, _SIDE_SAMPLES = 96, 40
_BEFORE_S, _AFTER_S = 0.1, 0.3
"""How much of tau is shown below and above the region, s."""


@dataclass(frozen=True)
class Box:
    """The part of the space that is drawn: `low` and `high`, (3,) each, in s, 1/s and m."""

    low: FloatArray
    high: FloatArray

    def scaled(self, states: FloatArray) -> FloatArray:
        """States (n, 3) in the drawing's units; what lies outside is put on the edge."""
        return (np.clip(states, self.low, self.high) - self.low) / (self.high - self.low)


def box_of(policy: Policy | None) -> Box:
    """What is drawn for a policy; without one the flights of the paper fit in."""
    if policy is None:
        return Box(np.array([0.0, -2.0, 0.0]), np.array([1.0, 12.0, 1.5]))
    vectors = policy.support_vectors * policy.scaler_std + policy.scaler_mean
    low, high = vectors.min(axis=0) - policy.scaler_std, vectors.max(axis=0) + policy.scaler_std
    return Box(
        np.array([max(0.0, policy.tau_min - _BEFORE_S), low[1], max(0.0, low[2])], dtype=np.float64),
        np.array([policy.tau_max + _AFTER_S, high[1], high[2]], dtype=np.float64),
    )


@dataclass(frozen=True)
class TriggerFaces:
    """Where the trigger fires, over a grid of theta_x and d_ceil.

    Attributes:
        theta_x, d_ceil: of the grid's points, 1/s and m, shape (n, n).
        first: largest tau that fires there, s; NaN where none does.
        last: smallest.
    """

    theta_x: FloatArray
    d_ceil: FloatArray
    first: FloatArray
    last: FloatArray


def trigger_faces(policy: Policy, box: Box) -> TriggerFaces:
    """The faces of the trigger's region within `box`, by the onboard arithmetic; linear between samples."""
    tau = np.linspace(float(policy.tau_min) - 1e-3, float(policy.tau_max) + 1e-3, _TAU_SAMPLES)
    sides = [np.linspace(box.low[i], box.high[i], _SIDE_SAMPLES) for i in (1, 2)]
    theta_x, d_ceil = np.meshgrid(*sides, indexing="ij")
    states = np.empty((*theta_x.shape, tau.size, 3), np.float32)
    states[..., 0], states[..., 1], states[..., 2] = tau, theta_x[..., None], d_ceil[..., None]
    values = trigger_values(policy.compiled(), states.reshape(-1, 3)).reshape(states.shape[:3])
    first = _outermost(values[..., ::-1], tau[::-1])
    return TriggerFaces(theta_x, d_ceil, first, _outermost(values, tau))


def _outermost(values: FloatArray, tau: FloatArray) -> FloatArray:
    """The first tau along the last axis at which the value rises through 0; NaN where it does not."""
    fires = values >= 0.0
    after = np.clip(np.argmax(fires, axis=-1), 1, None)
    index = np.indices(after.shape)
    low, high = values[(*index, after - 1)], values[(*index, after)]
    share = np.divide(-low, high - low, out=np.zeros(low.shape, np.float64), where=high > low)
    crossing = tau[after - 1] + np.clip(share, 0.0, 1.0) * (tau[after] - tau[after - 1])
    return np.where(fires.any(axis=-1), crossing, np.nan)


class CueSpace:
    """Draws the space, and the states as they come.

    Args:
        canvas: where it is drawn.
        policy: whose trigger is drawn, or None.
    """

    def __init__(self, canvas: Canvas, policy: Policy | None) -> None:
        import rerun as rr

        self._canvas = canvas
        self._box = box_of(policy)
        _draw_axes(canvas, self._box)
        if policy is not None:
            _draw_faces(canvas, self._box, trigger_faces(policy, self._box))
        for name, colour, radius in (
            ("trail", BLUE, 0.004),
            ("state", BLUE, 0.02),
            ("trigger", VERMILION, 0.03),
        ):
            points = rr.Points3D.from_fields(colors=[colour], radii=[radius])
            canvas.static(f"{ENTITY}/{name}", points)

    def add(self, news: RunRecord) -> None:
        """Move the state, and mark the trigger that the drone reported."""
        for topic, names in (("cues", ("trail", "state")), ("trigger", ("trigger",))):
            series = news.series.get(topic)
            if series is None:
                continue
            states = np.column_stack([series.numbers(axis) for axis in AXES])
            known = knows_ceiling(series) & ~np.isnan(states).any(axis=1)
            if topic == "trigger":
                known &= ~(series.numbers("count") == 0.0)  # a snapshot of nothing
            for name in names:
                points = self._box.scaled(states[known])
                self._canvas.trail(f"{ENTITY}/{name}", series.t[known], points)


def _draw_axes(canvas: Canvas, box: Box) -> None:
    """The box's edges from its origin, with ticks and their numbers."""
    import rerun as rr

    edges = [[np.zeros(3), np.eye(3)[i]] for i in range(3)]
    canvas.static(f"{ENTITY}/axes", rr.LineStrips3D(edges, colors=[GREY], radii=0.003))
    places, labels = [], []
    for i, (axis, unit) in enumerate(zip(AXES, _UNITS, strict=True)):
        for share in np.linspace(0.0, 1.0, _TICKS)[1:]:
            value = box.low[i] + share * (box.high[i] - box.low[i])
            places.append(share * np.eye(3)[i] - 0.06 * (1.0 - np.eye(3)[i]))
            labels.append(f"{axis} {value:.2f} {unit}" if share == 1.0 else f"{value:.2f}")
    ticks = rr.Points3D(places, labels=labels, colors=[GREY], radii=0.004, show_labels=True)
    canvas.static(f"{ENTITY}/ticks", ticks)


def _draw_faces(canvas: Canvas, box: Box, faces: TriggerFaces) -> None:
    import rerun as rr

    for name, tau, colour in (("fires_from", faces.first, ORANGE), ("fires_until", faces.last, SKY)):
        states = np.stack([tau, faces.theta_x, faces.d_ceil], axis=-1)
        triangles = _triangles(~np.isnan(tau))
        if not triangles.size:
            continue
        mesh = rr.Mesh3D(
            vertex_positions=box.scaled(np.nan_to_num(states).reshape(-1, 3)),
            triangle_indices=triangles,
            albedo_factor=(*colour, 130),
        )
        canvas.static(f"{ENTITY}/{name}", mesh)


def _triangles(known: NDArray[np.bool_]) -> NDArray[np.int64]:
    """Corners of the triangles between neighbours of a grid that are all known, (n, 3)."""
    numbers = np.arange(known.size).reshape(known.shape)
    corners = (numbers[:-1, :-1], numbers[1:, :-1], numbers[1:, 1:], numbers[:-1, 1:])
    whole = known[:-1, :-1] & known[1:, :-1] & known[1:, 1:] & known[:-1, 1:]
    a, b, c, d = (corner[whole] for corner in corners)
    return np.concatenate([np.column_stack([a, b, c]), np.column_stack([a, c, d])])
