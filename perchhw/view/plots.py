"""Numbers over time: which curves there are, their units, and the ranges in which they can be read.

A hover has a tau of a million seconds: a curve with a range shows what lies beyond at its edge. Cues of a
drone that has not been told of an approach, and so knows no ceiling, are left out.
"""

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from onboard.arrays import FloatArray
from onboard.record.run_record import RunRecord
from onboard.record.series_file import Series
from perchhw.record.palette import AXES, BLUE, FOUR, GREEN, ORANGE, PURPLE, VERMILION, Colour
from perchhw.view.timeline import Canvas


@dataclass(frozen=True)
class Curve:
    """One field of a topic over time.

    Attributes:
        name: of the entity, with its unit.
        label: in the legend.
        topic, field: of the record; a name of ``_DERIVED`` as topic takes what is computed from it.
        colour: of the line.
        scale: from the record's unit to that of the name.
        limits: what lies beyond is shown at the edge.
    """

    name: str
    label: str
    topic: str
    field: str
    colour: Colour
    scale: float = 1.0
    limits: tuple[float, float] = (-math.inf, math.inf)


@dataclass(frozen=True)
class Panel:
    """Curves of one unit in one plot; `limits`: of its axis, None to fit what is there."""

    name: str
    title: str
    curves: tuple[Curve, ...]
    limits: tuple[float, float] | None = None


def _axes(topic: str, names: str, unit: str, suffix: str, scale: float = 1.0) -> tuple[Curve, ...]:
    colours = FOUR if len(names.split()) == 4 else AXES
    return tuple(
        Curve(f"{name}_{suffix}", f"{name} [{unit}]", topic, name, colour, scale)
        for name, colour in zip(names.split(), colours, strict=True)
    )


def _one(
    panel: str, title: str, curve: tuple[str, str, str, str, Colour], limits: tuple[float, float]
) -> Panel:
    """A panel with one curve, cut at its limits."""
    return Panel(panel, title, (Curve(*curve, limits=limits),), limits)


_TAU, _THETA, _D_CEIL, _VALUE = (0.0, 2.0), (-2.0, 12.0), (0.0, 2.5), (-0.5, 0.5)
_GAP_MS = (0.0, 500.0)
_D_CEIL_MIN = 1e-3
"""m. A drone that was told no approach takes the ceiling to be where it stands."""

PANELS: tuple[Panel, ...] = (
    _one("tau", "tau [s], cut at 0 and 2", ("tau_s", "tau [s]", "cues", "tau", VERMILION), _TAU),
    _one(
        "theta_x",
        "theta_x [1/s], cut at -2 and 12",
        ("theta_x_1_s", "theta_x [1/s]", "cues", "theta_x", BLUE),
        _THETA,
    ),
    _one(
        "d_ceil",
        "d_ceil [m], cut at 0 and 2.5",
        ("d_ceil_m", "d_ceil [m]", "cues", "d_ceil", GREEN),
        _D_CEIL,
    ),
    _one(
        "policy",
        "trigger value [1], fires at 0",
        ("trigger_value", "trigger value [1]", "cues", "trigger_value", PURPLE),
        _VALUE,
    ),
    Panel("rates", "body rates [rad/s]", _axes("rates", "gx gy gz", "rad/s", "rad_s")),
    Panel("velocity", "velocity of the estimate [m/s]", _axes("estimate", "vx vy vz", "m/s", "m_s")),
    Panel(
        "motors",
        "motor commands [% of full]",
        _axes("motors", "m1 m2 m3 m4", "%", "percent", 100.0 / 65535.0),
        (0.0, 100.0),
    ),
    Panel("battery", "battery [V]", (Curve("vbat_v", "vbat [V]", "power", "vbat", GREEN),)),
    Panel(
        "link",
        "link and mocap: time between messages [ms], cut at 500",
        (
            Curve("link_gap_ms", "drone [ms]", "rates", "gap", VERMILION, 1e3, _GAP_MS),
            Curve("mocap_gap_ms", "mocap [ms]", "pose", "gap", BLUE, 1e3, _GAP_MS),
            Curve("mocap_age_ms", "age of a pose [ms]", "pose", "age", ORANGE, 1e3, _GAP_MS),
        ),
    ),
    Panel(
        "estimate_error",
        "estimate minus mocap [mm], cut at 500",
        (Curve("estimate_error_mm", "distance [mm]", "estimate", "error", PURPLE, 1e3, (0.0, 500.0)),),
    ),
)
"""Everything that is plotted; ``gap``, ``age`` and ``error`` are computed from the record."""


def entity(panel: Panel, curve: Curve) -> str:
    """Where a curve lives in the recording."""
    return f"plots/{panel.name}/{curve.name}"


@dataclass
class Plots:
    """Draws the curves as their messages come."""

    canvas: Canvas
    _last: dict[str, float] = field(default_factory=dict, init=False)
    _place: FloatArray | None = field(default=None, init=False)

    def __post_init__(self) -> None:
        import rerun as rr

        for panel in PANELS:
            for curve in panel.curves:
                lines = rr.SeriesLines(colors=[curve.colour], names=[curve.label], widths=[1.5])
                self.canvas.static(entity(panel, curve), lines)

    def add(self, news: RunRecord) -> None:
        """Draw what the new messages bring."""
        derived = {
            ("rates", "gap"): self._gaps(news.series.get("rates")),
            ("pose", "gap"): self._gaps(news.series.get("pose")),
            ("pose", "age"): _ages(news.series.get("pose")),
            ("estimate", "error"): self._errors(news.series.get("estimate"), news.series.get("pose")),
        }
        for panel in PANELS:
            for curve in panel.curves:
                series = news.series.get(curve.topic)
                if series is None:
                    continue
                values = derived.get((curve.topic, curve.field))
                if values is None:
                    values = series.numbers(curve.field)
                if curve.topic == "cues":
                    values = np.where(knows_ceiling(series), values, np.nan)
                shown = np.clip(values * curve.scale, *curve.limits)
                self.canvas.curve(entity(panel, curve), series.t, shown)

    def _gaps(self, series: Series | None) -> FloatArray | None:
        """Time since the message before, s; unknown (NaN) for the first of all."""
        if series is None:
            return None
        before = self._last.get(series.topic, math.nan)
        self._last[series.topic] = float(series.t[-1])
        return np.diff(series.t, prepend=before)

    def _errors(self, estimate: Series | None, pose: Series | None) -> FloatArray | None:
        """Distance of each estimated position from the newest measured one, m."""
        times, places = np.array([-math.inf]), np.full((1, 3), math.nan)
        if self._place is not None:
            places = self._place[None, :]
        if pose is not None:
            rows = _positions(pose)
            seen = ~np.isnan(rows).any(axis=1)
            times, places = np.append(times, pose.t[seen]), np.vstack([places, rows[seen]])
        self._place = places[-1]
        if estimate is None:
            return None
        newest = places[np.searchsorted(times, estimate.t, side="right") - 1]
        return np.linalg.norm(_positions(estimate) - newest, axis=1)


def knows_ceiling(cues: Series) -> NDArray[np.bool_]:
    """Which messages with cues come from a drone that knows where the ceiling is, (n,)."""
    known: NDArray[np.bool_] = cues.numbers("d_ceil") > _D_CEIL_MIN
    return known


def _positions(series: Series) -> FloatArray:
    return np.column_stack([series.numbers(axis) for axis in "xyz"])


def _ages(pose: Series | None) -> FloatArray | None:
    """Time from capture to receipt, s."""
    return None if pose is None else pose.t - pose.numbers("capture_time")
