"""The map of the landing rate that a campaign has found: what is expected at each condition, how surely."""

from typing import TYPE_CHECKING

import numpy as np

from calibration.report_style import INK, by_width, new_figure
from perchhw.campaign.adaptive import FlownMap

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from onboard.arrays import FloatArray

_MOST_LABELLED = 30
"""Conditions whose counts still fit beside their marks."""


def map_figure(found: FlownMap) -> str:
    """Two panels over speed and angle: the expected rate, and its standard deviation.

    What was flown is a disc with landings of attempts beside it, what was not is a square: its colour is what
    the others say of it.
    """
    best, least = int(np.argmax(found.known.rate)), int(np.argmax(found.known.deviation))
    (fast, steep), (speed, angle) = found.conditions[best], found.conditions[least]
    alt = (
        f"Map of the landing rate over {len(found.conditions)} conditions: "
        f"highest {fast:g} m/s {steep:g} deg ({found.known.rate[best]:.0%}), "
        f"least certain {speed:g} m/s {angle:g} deg (standard deviation {found.known.deviation[least]:.0%})"
    )
    return by_width(lambda broad: _drawn(found, broad), alt)


def _drawn(found: FlownMap, broad: bool) -> "Figure":
    figure = new_figure(10.4 if broad else 5.2, 4.0 if broad else 8.0)
    left, right = figure.subplots(*((1, 2) if broad else (2, 1))).flat
    _panel(left, found, found.known.rate, "expected landing rate", "cividis", 1.0)
    most = max(float(found.known.deviation.max()), 0.01)
    _panel(right, found, found.known.deviation, "its standard deviation", "Oranges", most)
    return figure


def _panel(
    axes: "Axes", found: FlownMap, values: "FloatArray", title: str, colours: str, most: float
) -> None:
    places, flown = np.array(found.conditions, np.float64), np.array(found.flown) > 0
    for rows, shape in ((flown, "o"), (~flown, "s")):
        drawn = axes.scatter(
            places[rows, 0], places[rows, 1], c=values[rows], marker=shape, s=90, cmap=colours,
            vmin=0.0, vmax=most, edgecolors=INK, lw=0.6,
        )  # fmt: skip
    if len(places) <= _MOST_LABELLED:
        for place, count, landed in zip(places, found.flown, found.landed, strict=True):
            words = f"{landed} of {count}" if count else ""
            axes.annotate(words, place, xytext=(8, 0), textcoords="offset points", fontsize=7, va="center")
    axes.set(xlabel="speed (m/s)", ylabel="approach angle (deg)")
    axes.set_title(title, loc="left", fontsize=10)
    axes.margins(0.2)
    assert axes.figure is not None
    axes.figure.colorbar(drawn, ax=axes, shrink=0.8)
