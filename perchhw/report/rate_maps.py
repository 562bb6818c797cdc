"""Landing rate over speed and approach angle as polar maps (paper, figures of policy performance and legs).

Radius is the commanded speed and the polar angle is the approach angle above the horizon, so that a map is a
picture of velocity space: across is the horizontal speed, up is the climb.
"""

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from calibration.report_style import INK, MUTED, new_figure
from onboard.arrays import FloatArray
from perchhw.learning.grid import Condition
from perchhw.learning.results import RateMap

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from matplotlib.projections.polar import PolarAxes

GOOD_RATE = 0.8
"""Landing rate from which a pair trains a policy; drawn as a line."""

RATE_COLOURS = "viridis"
_POINTS = 90
"""Of the drawn surface, in either direction."""
_BANDWIDTH = 0.8
"""Of the smoothing, in steps of the grid."""


def rate_maps(maps: Sequence[RateMap], columns: int | None = None) -> "Figure":
    """One polar map for each of `maps`, all with the same axes and colours.

    The surface is smoothed; the dots have the colours of the measured rates.

    Args:
        maps: at least one.
        columns: maps in a row; all of them without it.
    """
    columns = columns or len(maps)
    rows = math.ceil(len(maps) / columns)
    figure, axes = _panels(rows, columns)
    most = max(condition.speed for rates in maps for condition in rates.rates)
    surface: Any = None
    for k, panel in enumerate(axes.flat):
        if k >= len(maps):
            panel.set_visible(False)
            continue
        surface = _draw(panel, maps[k], most)
        label = f"({chr(ord('a') + k)}) " if len(maps) > 1 else ""
        panel.text(-0.02, 1.14, f"{label}{maps[k].name}", transform=panel.transAxes, fontsize=10.5)
    width, height = figure.get_size_inches()
    bar_height = min(3.0, height - 1.0)
    place = (1.0 - 0.82 / width, 0.5 - bar_height / 2 / height, 0.13 / width, bar_height / height)
    bar = figure.colorbar(surface, cax=figure.add_axes(place))
    bar.set_label("landing rate (four legs, no body contact)", fontsize=9)
    bar.ax.axhline(GOOD_RATE, color=INK, lw=1.6)
    return figure


def _panels(rows: int, columns: int) -> tuple["Figure", Any]:
    """A figure with (rows, columns) quarter circles at places of their own.

    The layout engine does not know the labels of a quarter circle.
    """
    width = {1: 5.2, 2: 8.4}.get(columns, 11.0)
    left, right, gap = 0.35, 1.25, 0.75
    top, bottom, between = 0.62, 0.52, 1.05
    side = (width - left - right - gap * (columns - 1)) / columns
    height = rows * side + top + bottom + between * (rows - 1)
    figure = new_figure(width, height)
    figure.set_layout_engine("none")
    axes = figure.subplots(
        rows, columns, squeeze=False, subplot_kw={"projection": "polar"},
        gridspec_kw={
            "left": left / width, "right": 1.0 - right / width, "wspace": gap / side,
            "top": 1.0 - top / height, "bottom": bottom / height, "hspace": between / side,
        },
    )  # fmt: skip
    return figure, axes


def _draw(panel: "PolarAxes", rates: RateMap, most: float) -> Any:
    """One map; returns what the colour bar needs."""
    conditions = np.array(sorted(rates.rates), np.float64)
    values = np.array([rates.rates[Condition(*c)] for c in conditions])
    speeds, angles = (_fine(conditions[:, k]) for k in (0, 1))
    smooth = smoothed(conditions, values, speeds, angles)
    radians = np.radians(angles)
    surface = panel.pcolormesh(
        radians, speeds, smooth, cmap=RATE_COLOURS, vmin=0.0, vmax=1.0, shading="gouraud", rasterized=True
    )
    _contour(panel, radians, speeds, smooth, GOOD_RATE, INK, "-")
    if rates.trigger_rates is not None:
        fired = np.array([rates.trigger_rates[Condition(*c)] for c in conditions])
        share = smoothed(conditions, fired, speeds, angles)
        _contour(panel, radians, speeds, share, 0.5, "#ff9d2e", "--")
    panel.scatter(
        np.radians(conditions[:, 1]), conditions[:, 0], c=values, s=7, cmap=RATE_COLOURS, vmin=0.0, vmax=1.0,
        edgecolors="white", linewidths=0.35, zorder=3, clip_on=False,
    )  # fmt: skip
    _frame(panel, most)
    return surface


def _contour(
    panel: "PolarAxes", radians: FloatArray, speeds: FloatArray, values: FloatArray, level: float,
    colour: str, style: str,
) -> None:  # fmt: skip
    if values.min() < level < values.max():
        panel.contour(
            radians, speeds, values, levels=[level], colors=colour, linewidths=1.4, linestyles=style, zorder=4
        )


def _frame(panel: "PolarAxes", most: float) -> None:
    """Axes of a quarter circle: speed outwards, 0 to 90 deg."""
    panel.set_thetamin(0)
    panel.set_thetamax(90)
    panel.set_ylim(0.0, most * 1.02)
    panel.set_thetagrids(np.arange(0, 91, 15))
    panel.set_rgrids(np.arange(1, math.floor(most) + 1))
    panel.tick_params(labelsize=8.5, labelcolor=INK, pad=2)
    panel.grid(color="#d5dade", lw=0.6)
    panel.spines["polar"].set_color(MUTED)
    panel.text(0.5, -0.125, "speed (m/s)", transform=panel.transAxes, ha="center", va="center", fontsize=9)
    middle = math.radians(45)
    panel.text(
        middle, most * 1.17, "approach angle", rotation=-45, ha="center", va="center", fontsize=9,
        rotation_mode="anchor",
    )  # fmt: skip


def _fine(values: FloatArray) -> FloatArray:
    """The range of a grid's values in small steps; half a unit wide around a single value."""
    low, high = float(values.min()), float(values.max())
    if low == high:
        low, high = 0.98 * low, min(1.02 * high, 90.0)
    return np.linspace(low, high, _POINTS)


def smoothed(
    conditions: FloatArray, values: FloatArray, speeds: FloatArray, angles: FloatArray
) -> FloatArray:
    """Kernel regression (Nadaraya 1964, Watson 1964) of values at scattered conditions.

    Args:
        conditions: (n, 2) speed (m/s) and angle (deg).
        values: (n,).
        speeds: (p,) and angles: (q,): where it is wanted.

    Returns:
        (p, q), each between the least and the greatest of `values`.
    """
    distance = []
    for k, wanted in ((0, speeds), (1, angles)):
        steps = np.diff(np.unique(conditions[:, k]))
        width = _BANDWIDTH * (float(np.median(steps)) if len(steps) else 1.0)
        distance.append(((wanted[:, None] - conditions[:, k]) / width) ** 2)
    # The nearest condition has weight one: far from all of them the weights would vanish.
    exponent = -0.5 * (distance[0][:, None, :] + distance[1][None, :, :])
    weights = np.exp(exponent - exponent.max(axis=2, keepdims=True))
    means: FloatArray = weights @ values / weights.sum(axis=2)
    return means
