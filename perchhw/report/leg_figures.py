"""Why leg designs succeed and fail: the four factors of the paper's section V.E beside the success rate."""

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from calibration.report_style import BLUE, INK, MUTED, ORANGE, new_figure
from onboard.arrays import BoolArray, FloatArray
from perchhw.learning.leg_results import GRAVITY, MOMENTUM, SWING, WINDOW, LegLandings, LegResults

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


class Factor(NamedTuple):
    """How one factor is drawn: column of the landings, axis label, factor to the label's unit."""

    column: str
    label: str
    scale: float


FACTORS = (
    Factor(SWING, "swing distance (mm)", 1e3),
    Factor(GRAVITY, "gravity's contribution (mJ)", 1e3),
    Factor(MOMENTUM, "swing rate after contact (rad/s)", 1.0),
    Factor(WINDOW, "impact window margin (deg)", 1.0),
)

_FAMILIES = {"narrow": (BLUE, "o"), "semi-narrow": ("#009e73", "^"), "wide": (ORANGE, "s")}
_OTHER = (MUTED, "D")
_FEWEST = 5
"""Landings below which a median is not drawn."""


def _look(design: str) -> dict[str, object]:
    """Colour and marker by family, dashes for short legs."""
    family, _, length = design.rpartition("-")
    colour, marker = _FAMILIES.get(family, _OTHER)
    return {"color": colour, "marker": marker, "ls": "--" if length == "short" else "-"}


def factors_by_angle(results: LegResults) -> "Figure":
    """Success rate and medians of the four factors by design and band of the approach angle."""
    landings, bands = results.landings, results.bands_deg()
    figure = new_figure(10.6, 5.6)
    panels = figure.subplots(2, 3).ravel()
    at = np.arange(len(bands), dtype=float)
    for number, design in enumerate(results.maps):
        shift = 0.05 * (number - (len(results.maps) - 1) / 2)
        inside = [_within(landings, design, band) for band in bands]
        rates = [float(landings.success[rows].mean()) if rows.any() else np.nan for rows in inside]
        panels[0].plot(at + shift, rates, ms=5, lw=1.5, label=design, **_look(design))
        for axes, factor in zip(panels[1:5], FACTORS, strict=True):
            values = landings.factors[factor.column] * factor.scale
            medians = [_median(values[rows]) for rows in inside]
            axes.plot(at + shift, medians, ms=5, lw=1.5, **_look(design))
    panels[0].set(ylabel="success rate", ylim=(-0.03, 1.03))
    for axes, factor in zip(panels[1:5], FACTORS, strict=True):
        axes.set_ylabel(factor.label)
        if factor.column != SWING:
            axes.axhline(0.0, color=INK, lw=0.9)
    for axes in panels[:5]:
        axes.set_xticks(at, [f"{low:g}-{high:g}" for low, high in bands])
        axes.set_xlabel("approach angle (deg)")
    panels[5].axis("off")
    panels[5].legend(*panels[0].get_legend_handles_labels(), loc="center", frameon=False, handlelength=3.2)
    return figure


def _within(landings: LegLandings, design: str, band: tuple[float, float]) -> BoolArray:
    low, high = band
    angle = landings.angle_deg
    return (
        (landings.design == design) & (angle >= low) & ((angle < high) | ((high >= 90.0) & (angle <= high)))
    )


def _median(values: FloatArray) -> float:
    values = values[np.isfinite(values)]
    return float(np.median(values)) if len(values) >= _FEWEST else float("nan")


def success_and_failure(results: LegResults) -> "Figure":
    """Medians and middle halves of the four factors over the landings that succeeded and that failed."""
    landings, designs = results.landings, list(results.maps)
    figure = new_figure(10.6, 0.42 * len(designs) + 1.5)
    panels = figure.subplots(1, len(FACTORS), sharey=True)
    for axes, factor in zip(panels, FACTORS, strict=True):
        values = landings.factors[factor.column] * factor.scale
        for row, design in enumerate(designs):
            own = (landings.design == design) & np.isfinite(values)
            _draw_half(axes, values[own & landings.success], row - 0.13, BLUE, "o", "succeeded")
            _draw_half(axes, values[own & ~landings.success], row + 0.13, ORANGE, "s", "failed")
        if factor.column != SWING:
            axes.axvline(0.0, color=INK, lw=0.9)
        axes.set_xlabel(factor.label)
        axes.grid(axis="y", visible=False)
    panels[0].set_yticks(range(len(designs)), designs)
    panels[0].invert_yaxis()
    handles, labels = panels[0].get_legend_handles_labels()
    shown = dict(zip(labels, handles, strict=True))
    figure.legend(shown.values(), shown.keys(), loc="outside upper center", ncols=2, frameon=False)
    return figure


def _draw_half(axes: "Axes", values: FloatArray, at: float, colour: str, marker: str, label: str) -> None:
    """Median as a marker and the middle half as a line."""
    if len(values) < _FEWEST:
        return
    low, middle, high = np.percentile(values, (25, 50, 75))
    axes.plot([low, high], [at, at], color=colour, lw=2.4, alpha=0.55, solid_capstyle="round")
    axes.plot(middle, at, marker, color=colour, ms=6, mec="white", mew=0.6, label=label)
