"""Plots of a tachometer result, for reports."""

from typing import TYPE_CHECKING

import numpy as np

from calibration.bench.motors.direction import DirectionFit, predicted
from calibration.bench.motors.settling import local_constant, time_to_share
from calibration.bench.motors.tachometer_result import TachometerResult
from calibration.report_style import BLUE, GREEN, INK, MUTED, ORANGE, new_figure, report_style
from onboard.gravity import GRAM_FORCE

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_SHOWN = 0.8
"""s after the begin of a step."""
_SAMPLES = 300


def steps_figure(result: TachometerResult) -> "Figure":
    """All steps on the time since their begin, with the shared law; residuals below. Left up, right down."""
    with report_style():
        figure = new_figure(9.0, 5.0)
        axes = figure.subplots(2, 2, sharex=True, height_ratios=(3, 1), squeeze=False)
        for column, (name, fit) in enumerate((("up", result.up), ("down", result.down))):
            axes[0][column].set_title(f"Steps {name}", loc="left")
            axes[1][column].set_xlabel("s since the step")
            if fit is not None:
                _draw_direction(fit, axes[0][column], axes[1][column])
        axes[0][0].set_ylabel("rad/s")
        axes[1][0].set_ylabel("left, rad/s")
    return figure


def _draw_direction(fit: DirectionFit, speeds: "Axes", rest: "Axes") -> None:
    t = np.linspace(-0.1, _SHOWN, _SAMPLES)
    for index, step in enumerate(fit.steps):
        inside = slice(step.first, step.last)
        middle = 0.5 * (step.trace.start + step.trace.end)[inside] - fit.fit.begins[index]
        shown = (middle > t[0]) & (middle < t[-1])
        speeds.plot(middle[shown], step.trace.speed[inside][shown], ".", ms=3, color=ORANGE)
        law = predicted(fit.fit, index, t + fit.fit.begins[index], fit.a.value, fit.b.value)
        speeds.plot(t, law, lw=1.0, color=BLUE)
        residuals = -fit.fit.residuals[fit.fit.step_of == index]
        rest.plot(middle[shown], residuals[shown], ".", ms=2, color=MUTED)


def constants_figure(result: TachometerResult) -> "Figure":
    """Local time constant against thrust, and what first-order fits of single steps gave."""
    with report_style():
        figure = new_figure(6.0, 3.6)
        axes = figure.add_subplot()
        thrusts = np.linspace(1.0, 14.0, 60)
        for fit, colour, name in ((result.up, BLUE, "up"), (result.down, GREEN, "down")):
            if fit is None:
                continue
            speeds = [result.propeller.speed(f * GRAM_FORCE) for f in thrusts]
            local = [1e3 * local_constant(w, fit.a.value, fit.b.value) for w in speeds]
            axes.plot(thrusts, local, color=colour, label=f"small changes, {name}")
        for index, row in enumerate(result.steps):
            thrust = result.propeller.thrust(max(row.start, row.end)) / GRAM_FORCE
            label = "single steps: first-order thrust" if index == 0 else None
            axes.plot(thrust, 1e3 * row.thrust_constant, "o", ms=5, mfc="none", color=ORANGE, label=label)
            label = "single steps: 63 % by the law" if index == 0 else None
            axes.plot(thrust, 1e3 * row.time_63, "x", ms=5, color=INK, label=label)
        axes.set(xlabel="gf (of a step: its higher thrust)", ylabel="ms")
        axes.set_ylim(bottom=0.0)
        axes.legend(frameon=False, fontsize=8.5)
    return figure


def sizes_figure(result: TachometerResult) -> "Figure":
    """63 % time of steps from each thrust to rest and back: why one constant does not do."""
    with report_style():
        figure = new_figure(6.0, 3.2)
        axes = figure.add_subplot()
        thrusts = np.linspace(2.0, 14.0, 40)
        speeds = [result.propeller.speed(f * GRAM_FORCE) for f in thrusts]
        if result.up is not None:
            a, b = result.up.a.value, result.up.b.value
            axes.plot(
                thrusts, [1e3 * time_to_share(0.0, w, a, b) for w in speeds], color=BLUE, label="from rest"
            )
        if result.down is not None:
            a, b = result.down.a.value, result.down.b.value
            axes.plot(
                thrusts, [1e3 * time_to_share(w, 0.0, a, b) for w in speeds], color=GREEN, label="to rest"
            )
        axes.set(xlabel="gf", ylabel="63 % time, ms")
        axes.set_ylim(bottom=0.0)
        axes.legend(frameon=False)
    return figure
