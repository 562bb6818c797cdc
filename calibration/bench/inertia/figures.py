"""Figures of a bifilar report: one swing, the trials, the budget."""

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from calibration.bench.inertia.inertia import InertiaResult
from calibration.bench.inertia.swing_fit import SwingFit
from calibration.report_style import BLUE, GREEN, INK, MUTED, ORANGE, TRIGGER, new_figure, report_style

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def swing_figure(fit: SwingFit) -> "Figure":
    """The recorded rate with the fit, its envelope, and what the fit leaves."""
    with report_style():
        figure = new_figure(7.2, 3.8)
        above, below = figure.subplots(2, 1, sharex=True, height_ratios=[2.2, 1.0])
        fine = np.linspace(fit.time[0], fit.time[-1], max(len(fit.time), 400))
        above.plot(fit.time, fit.rate, ".", color=MUTED, markersize=2, label="gyro about the axis")
        above.plot(fine, np.interp(fine, fit.time, fit.fitted), color=BLUE, linewidth=0.9, label="fit")
        above.plot(fit.envelope.time, fit.envelope.amplitude, color=ORANGE, linewidth=1.1, label="amplitude")
        above.set_ylabel("rate [rad/s]")
        above.set_title(
            f"T0 = {fit.period.value:.4f} s, {math.degrees(fit.start_amplitude):.1f} to "
            f"{math.degrees(fit.end_amplitude):.1f} deg, {fit.cycles:.1f} cycles",
            color=INK,
            fontsize=9.5,
            loc="left",
        )
        above.legend(loc="upper right", ncols=3, frameon=False, fontsize=8)
        below.plot(fit.time, 1e3 * (fit.rate - fit.fitted), color=MUTED, linewidth=0.6)
        below.set_ylabel("left [mrad/s]")
        below.set_xlabel("time [s]")
    return figure


def trials_figure(fits: Sequence[SwingFit]) -> "Figure":
    """Period of each trial: the fit, the zero crossings, and the damped sine that ignores the amplitude."""
    with report_style():
        figure = new_figure(7.2, 2.8)
        axes = figure.subplots()
        number = np.arange(1, len(fits) + 1)
        axes.plot(
            number, [fit.sine_period for fit in fits], "x", color=MUTED, label="damped sine, not corrected"
        )
        crossings = [math.nan if fit.crossing_period is None else fit.crossing_period for fit in fits]
        axes.plot(number, crossings, "s", color=ORANGE, markersize=4, label="zero crossings")
        colours = [TRIGGER if fit.rejected else BLUE for fit in fits]
        axes.scatter(
            number, [fit.period.value for fit in fits], color=colours, s=26, zorder=3, label="pendulum law"
        )
        axes.axhline(float(np.mean([fit.period.value for fit in fits])), color=BLUE, linewidth=0.8)
        axes.set_xticks(number)
        axes.set_xlabel("trial (red: rejected)")
        axes.set_ylabel("period [s]")
        axes.legend(loc="best", frameon=False, fontsize=8)
    return figure


def budget_figure(result: InertiaResult) -> "Figure":
    """Contributions to the standard uncertainty, largest first."""
    with report_style():
        lines = [one for one in result.budget if one.share > 0.0]
        figure = new_figure(7.2, 0.7 + 0.27 * len(lines))
        axes = figure.subplots()
        place = np.arange(len(lines))
        axes.barh(place, [100.0 * one.share for one in lines], color=[ORANGE, *[BLUE] * (len(lines) - 1)])
        for k, one in enumerate(lines):
            axes.text(
                100.0 * one.share, k, f"  {100.0 * one.share:.2g} %", va="center", fontsize=8, color=INK
            )
        total = 100.0 * result.inertia.sigma / result.inertia.value
        axes.axvline(total, color=GREEN, linewidth=1.2)
        axes.text(total, len(lines) - 0.6, f" all {total:.2f} %", color=GREEN, fontsize=8, va="bottom")
        if lines[0].advice:
            title = f"To know it better: {lines[0].advice} ({lines[0].name})."
            axes.set_title(title, color=INK, fontsize=9.5, loc="left")
        axes.set_yticks(place, [one.name for one in lines])
        axes.invert_yaxis()
        axes.margins(x=0.25)
        axes.grid(visible=False, axis="y")
        axes.set_xlabel("share of the inertia [%], k = 1")
    return figure
