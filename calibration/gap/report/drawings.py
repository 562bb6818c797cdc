"""The figures of a report, drawn: each function takes what it shows and gives a matplotlib figure."""

from collections.abc import Callable, Iterable, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from calibration.gap.replay.closed_loop import ClosedLoopFlight
from calibration.gap.report.document import METRIC, Gap, Levels
from calibration.gap.report.figures_data import AlongRegressor
from calibration.gap.report.words import plain
from calibration.gap.unnamed.gap_map import GapMap
from calibration.report_style import BLUE, INK, MUTED, ORANGE, new_figure
from onboard.arrays import FloatArray

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_BEFORE, _AFTER, _FLOOR = ORANGE, BLUE, MUTED
CURVES = (METRIC, "velocity, attitude given", "attitude, all predicted")
"""Quantities that are drawn against the horizon."""

_PARTS = 14
"""Parts of equal count that a cloud is drawn in."""
_FEWEST = 8
"""Points that a part needs."""
_ROW = 3
"""Panels side by side."""
_LEGEND_COLUMN = 1.3
"""Inches that a name in a legend takes."""


def stage_colours(stages: Iterable[str]) -> dict[str, object]:
    """First stage orange, last blue, those between from light to dark grey-blue."""
    from matplotlib import colormaps

    names = list(stages)
    shades = colormaps["GnBu"](np.linspace(0.45, 0.75, max(len(names) - 2, 1)))
    between: dict[str, object] = dict(zip(names[1:-1], shades, strict=False))
    return {**between, names[-1]: _AFTER, names[0]: _BEFORE}


def horizon_panels(stages: Mapping[str, Gap], broad: bool) -> "Figure":
    """Errors against the horizon, one panel a quantity, one curve a stage, the floor dashed."""
    gaps, colours = list(stages.values()), stage_colours(stages)
    figure, axes = _panels(len(CURVES), 3.1, _ROW if broad else 1)
    for panel, quantity in zip(axes, CURVES, strict=True):
        for name, gap in stages.items():
            errors = {horizon: one.after for horizon, one in gap.predictions[quantity].items()}
            width = 2.0 if gap in (gaps[0], gaps[-1]) else 1.2
            panel.plot([*errors], [*errors.values()], "o-", ms=4, lw=width, color=colours[name], label=name)
        levels = gaps[0].predictions[quantity]
        floor = {horizon: one.noise_floor for horizon, one in levels.items() if one.noise_floor is not None}
        if floor:
            panel.plot([*floor], [*floor.values()], "--", lw=1.4, color=_FLOOR, label="floor")
        unit = next((one.unit for one in levels.values()), "")  # no level where every model ran away
        panel.set(xlabel="s ahead", ylabel=unit, xscale="log", yscale="log")
        panel.set_xticks([*levels], [f"{horizon:g}" for horizon in levels])
        panel.minorticks_off()
        _plain_decades(panel)
        panel.set_title(quantity, fontsize=9.5, loc="left")
    _shared_legend(figure, axes)
    return figure


def stage_bars(stages: Mapping[str, Mapping[str, Levels]], along: str, relative: bool) -> "Figure":
    """Grouped bars, one a stage for each label; a dash marks the floor.

    Args:
        stages: levels by label, of each stage by name.
        along: what the axis says.
        relative: whether to draw shares of what was before, instead of numbers in their unit.
    """
    first = next(iter(stages.values()))
    units = {label: levels.before if relative else 1.0 for label, levels in first.items()}
    figure = new_figure(5.2, max(2.0, 0.5 + len(first) * (0.16 * len(stages) + 0.14)))
    axes = figure.add_subplot()
    colours = stage_colours(stages)
    height = 0.8 / len(stages)
    at = np.arange(len(first))
    handles: dict[str, Any] = {}
    for index, (name, levels) in enumerate(stages.items()):
        offset = (index - 0.5 * (len(stages) - 1)) * height
        lengths = [levels[label].after / unit if label in levels else 0.0 for label, unit in units.items()]
        handles[name] = axes.barh(at + offset, lengths, height=0.92 * height, color=colours[name])
    for y, (label, unit) in zip(at, units.items(), strict=True):
        floor = first[label].noise_floor
        if floor is not None:
            handles["floor"] = axes.plot([floor / unit] * 2, [y - 0.42, y + 0.42], color=INK, lw=1.6)[0]
    axes.set_yticks(at, [plain(label) for label in units])
    axes.invert_yaxis()
    axes.grid(axis="y", visible=False)
    axes.set_xlabel(along)
    _legend(figure, handles)
    return figure


def heat_maps(maps: tuple[GapMap, GapMap]) -> "Figure":
    """Before and after side by side; what chance could have made before is faint."""
    before, _ = maps
    rows, columns = before.share.shape
    figure = new_figure(10.4, 1.5 + 0.36 * rows)
    shares = [np.clip(one.share, 0.0, 1.0) for one in maps]
    most = max(*(float(np.nanmax(share, initial=0.0)) for share in shares), 1e-3)
    image = None
    pair = figure.subplots(1, 2, sharey=True)
    for axes, cells, title in zip(pair, shares, ("before", "after"), strict=True):
        faint = np.where(cells > before.chance, 1.0, 0.3)
        image = axes.imshow(
            np.nan_to_num(cells), cmap="YlOrRd", vmin=0.0, vmax=most, aspect="auto", alpha=faint
        )
        for (row, column), value in np.ndenumerate(cells):
            if np.isfinite(value):
                dark = value > 0.6 * most and faint[row, column] == 1.0
                axes.text(
                    column, row, f"{100 * value:.0f}", ha="center", va="center", fontsize=8,
                    color="white" if dark else INK, alpha=0.55 if faint[row, column] < 1.0 else 1.0,
                )  # fmt: skip
        axes.set_xticks(range(columns), [plain(r) for r in before.regressors], rotation=40, ha="right")
        axes.set_yticks(range(rows), [plain(c) for c in before.channels])
        axes.grid(visible=False)
        axes.tick_params(length=0)
        axes.set_title(title, fontsize=9.5, loc="left")
        for spine in axes.spines.values():
            spine.set_visible(False)
    if image is not None:
        figure.colorbar(image, ax=pair, pad=0.01, shrink=0.9, format=lambda share, _: f"{100 * share:.0f} %")
    return figure


def cloud_panels(clouds: tuple[AlongRegressor, ...]) -> "Figure":
    """Median and middle two thirds of the residual over parts of the regressor, before and after."""

    def draw(panel: "Axes", data: AlongRegressor) -> None:
        for values, colour, name in ((data.first, _BEFORE, "before"), (data.second, _AFTER, "after")):
            x, low, middle, high = quantile_bands(data.x, values)
            panel.fill_between(x, low, high, color=colour, alpha=0.15, lw=0)
            panel.plot(x, middle, "o-", ms=3, lw=1.5, color=colour, label=name)
        panel.axhline(0.0, color=MUTED, lw=0.8)

    return _along_regressors(clouds, draw, 2.7)


def effect_panels(pictures: tuple[AlongRegressor, ...]) -> "Figure":
    """Per effect: the data beyond a model without it (medians, middle two thirds), and what it says."""

    def draw(panel: "Axes", data: AlongRegressor) -> None:
        panel.axhline(0.0, color=_BEFORE, lw=1.4, label="model without it")
        x, low, middle, high = quantile_bands(data.x, data.first)
        panel.fill_between(x, low, high, color=INK, alpha=0.12, lw=0)
        panel.plot(x, middle, "o", ms=3.5, color=INK, label="flights")
        x, _, middle, _ = quantile_bands(data.x, data.second)
        panel.plot(x, middle, lw=1.8, color=_AFTER, label="with it")
        panel.set_title(plain(data.effect), fontsize=9.5, loc="left")

    return _along_regressors(pictures, draw, 2.9)


def _along_regressors(
    every: tuple[AlongRegressor, ...], draw: "Callable[[Axes, AlongRegressor], None]", height: float
) -> "Figure":
    """One panel each, which `draw` fills."""
    figure, axes = _panels(len(every), height)
    for panel, data in zip(axes, every, strict=True):
        draw(panel, data)
        behind = f" ({data.regressor_unit})" if data.regressor_unit else ""
        panel.set_xlabel(f"{plain(data.regressor)}{behind}")
        panel.set_ylabel(f"{plain(data.channel)} ({data.channel_unit})")
    _shared_legend(figure, axes)
    return figure


def quantile_bands(x: FloatArray, y: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Median of `x`, and 1/6, 1/2 and 5/6 quantiles of `y`, in parts of `x` of equal count; shapes (k,)."""
    finite = np.isfinite(x) & np.isfinite(y)
    order = np.argsort(x[finite], kind="stable")
    parts = min(_PARTS, order.size // _FEWEST)
    if parts == 0:
        return np.empty(0), np.empty(0), np.empty(0), np.empty(0)
    rows = np.array_split(order, parts)
    middle = np.array([np.median(x[finite][part]) for part in rows])
    bands = np.array([np.quantile(y[finite][part], [1 / 6, 0.5, 5 / 6]) for part in rows])
    return middle, bands[:, 0], bands[:, 1], bands[:, 2]


def closed_loop_trace(stages: Mapping[str, ClosedLoopFlight]) -> "Figure":
    """Duty and tilt that the flight had and that the model needs."""
    figure = new_figure(10.4, 3.6)
    top, bottom = figure.subplots(2, 1, sharex=True)
    one, colours = next(iter(stages.values())), stage_colours(stages)
    t = one.t - one.t[0]
    duties = {name: flight.needed_duty for name, flight in stages.items()}
    tilts = {name: _tilt_deg(flight.needed_attitude) for name, flight in stages.items()}
    rows = (
        (top, np.where(one.known, one.duty, np.nan), duties, "duty (share of battery)"),
        (bottom, _tilt_deg(one.attitude), tilts, "tilt (deg)"),
    )
    for axes, measured, needed, label in rows:
        for name, values in needed.items():
            axes.plot(t, values, lw=1.2, color=colours[name], label=name)
        axes.plot(t, measured, lw=1.0, color=INK, alpha=0.75, label="measured")
        axes.set_ylabel(label)
    bottom.set_xlabel("s")
    _shared_legend(figure, [top])
    return figure


def _tilt_deg(attitude: FloatArray) -> FloatArray:
    """Angle between body axis and vertical, shape (n,), of quaternions, shape (n, 4)."""
    up = 1.0 - 2.0 * (attitude[:, 0] ** 2 + attitude[:, 1] ** 2)
    return np.degrees(np.arccos(np.clip(up, -1.0, 1.0)))


def _panels(count: int, height: float, side_by_side: int = _ROW) -> "tuple[Figure, list[Axes]]":
    """A figure with `count` panels in rows of `side_by_side`."""
    rows, columns = -(-count // side_by_side), min(count, side_by_side)
    figure = new_figure(10.4 * columns / _ROW, height * rows)
    axes = list(figure.subplots(rows, columns, squeeze=False).ravel())
    for spare in axes[count:]:
        spare.remove()
    return figure, axes[:count]


def _plain_decades(axes: "Axes") -> None:
    """Ticks of a logarithmic axis as plain numbers at 1, 2 and 5 of each decade."""
    from matplotlib.ticker import FuncFormatter, LogLocator

    axes.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))


def _shared_legend(figure: "Figure", axes: "list[Axes]") -> None:
    """One legend above all panels, every name once."""
    named: dict[str, Any] = {}
    for panel in axes:
        for handle, label in zip(*panel.get_legend_handles_labels(), strict=True):
            named.setdefault(label, handle)
    _legend(figure, named)


def _legend(figure: "Figure", named: dict[str, Any]) -> None:
    """A legend above everything, in as many columns as fit."""
    columns = max(1, int(figure.get_figwidth() / _LEGEND_COLUMN))
    figure.legend(
        list(named.values()),
        list(named),
        loc="outside upper left",
        ncols=columns,
        frameon=False,
        fontsize=8.5,
    )
