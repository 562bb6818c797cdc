"""Plots of a capture result, for reports."""

from typing import TYPE_CHECKING

import numpy as np
from scipy.special import ndtr

from calibration.bench.capture.fit import SHARPEST, CaptureFit
from calibration.report_style import BLUE, ORANGE, new_figure, report_style

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def capture_figure(fit: CaptureFit) -> "Figure":
    """Shares that stuck, with Jeffreys' 95 % intervals, the fitted curve and its band."""
    from scipy.stats import beta

    drops = fit.drops
    speed = np.linspace(0.0, 1.2 * float(drops.speed.max()), 200)
    every = slice(None, None, 4)
    inside = fit.deviance[every, every] <= 5.99  # both parameters together, 95 %
    rows, columns = np.nonzero(inside)
    z = (speed - fit.speeds[every][rows, None]) / fit.spreads[every][columns, None]
    curves = ndtr(z)
    with report_style():
        figure = new_figure(6.4, 3.6)
        axes = figure.subplots()
        axes.fill_between(
            speed, curves.min(axis=0), curves.max(axis=0), color=BLUE, alpha=0.15, lw=0.0, label="95 % band"
        )
        best = ndtr((speed - fit.speed) / max(fit.spread, SHARPEST))
        axes.plot(speed, best, color=BLUE, lw=1.4, label="fit")
        share = drops.stuck / drops.thrown
        low, high = (beta.ppf(q, drops.stuck + 0.5, drops.thrown - drops.stuck + 0.5) for q in (0.025, 0.975))
        bars = np.maximum(np.stack([share - low, high - share]), 0.0)
        axes.errorbar(drops.speed, share, yerr=bars, fmt="o", ms=4, lw=1.0, color=ORANGE, label="dropped")
        axes.set(xlabel="normal speed at touch, m/s", ylabel="share that stuck", ylim=(-0.03, 1.03))
        axes.legend(frameon=False, fontsize=8.5)
    return figure
