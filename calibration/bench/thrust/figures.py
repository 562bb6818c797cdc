"""Plots of a thrust result, for reports."""

from typing import TYPE_CHECKING

import numpy as np

from calibration.bench.thrust.compensation import Discharge, Verification
from calibration.bench.thrust.thrust_result import ThrustResult
from calibration.report_style import BLUE, GREEN, MUTED, ORANGE, TRIGGER, new_figure, report_style
from onboard.gravity import GRAM_FORCE

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_SAMPLES = 300
_COLOURS = {"firmware_cubic": BLUE, "two_region_log": GREEN, "two_quadratic": MUTED}


def curve_figure(result: ThrustResult) -> "Figure":
    """Points, the forms that a vehicle may hold, and the 95 % band of the chosen one; residuals below."""
    with report_style():
        figure = new_figure(6.4, 5.2)
        curves, rest = figure.subplots(2, 1, sharex=True, height_ratios=(3, 1))
        voltage = np.linspace(0.0, 1.05 * float(np.max(result.data.voltage)), _SAMPLES)
        centre = result.best.fit.thrust_at(voltage)
        band = result.band(voltage) / GRAM_FORCE
        curves.fill_between(
            voltage, centre - band, centre + band, color=BLUE, alpha=0.15, lw=0.0, label="95 % band"
        )
        for name, colour in _COLOURS.items():
            if name not in result.forms:
                continue
            fit = result.forms[name].fit
            label = f"{name}{' (chosen)' if name == result.chosen else ''}"
            curves.plot(voltage, fit.thrust_at(voltage), color=colour, lw=1.3, label=label)
            rest.plot(fit.voltage, fit.residuals, ".", ms=4, color=colour)
        curves.plot(
            result.data.voltage, result.data.thrust / GRAM_FORCE, "o", ms=4, color=ORANGE, label="measured"
        )
        curves.set(ylabel="gf", ylim=(min(0.0, float(np.min(centre))), None))
        curves.legend(frameon=False, fontsize=8.5)
        rest.axhline(0.0, color=MUTED, lw=0.8)
        rest.set(xlabel="V at the motor", ylabel="left, gf")
    return figure


def validation_figure(result: ThrustResult) -> "Figure":
    """Error of every form in blocks that its fit did not see."""
    with report_style():
        figure = new_figure(6.4, 3.0)
        axes = figure.add_subplot()
        names = sorted(result.forms, key=lambda name: result.forms[name].cross_validation)
        for at, name in enumerate(names):
            report = result.forms[name]
            colour = BLUE if name == result.chosen else (GREEN if report.usable else MUTED)
            axes.errorbar(
                report.cross_validation,
                at,
                xerr=report.cross_validation_error,
                fmt="o",
                color=colour,
                capsize=3,
            )
        axes.set_yticks(range(len(names)), names)
        axes.set_xlabel("gf, rms of blocks left out (bars: standard error)")
        axes.invert_yaxis()
    return figure


def discharge_figure(discharge: Discharge, verification: Verification) -> "Figure":
    """Thrust asked for and measured over a discharge, with the saturated readings marked."""
    with report_style():
        figure = new_figure(6.4, 3.2)
        axes = figure.add_subplot()
        axes.plot(discharge.battery, discharge.requested / GRAM_FORCE, color=MUTED, lw=1.2, label="asked for")
        measured = discharge.measured / GRAM_FORCE
        held, full = verification.judged, verification.saturated
        axes.plot(discharge.battery[held], measured[held], ".", color=BLUE, label="measured")
        axes.plot(discharge.battery[full], measured[full], "x", color=TRIGGER, label="saturated")
        axes.set(xlabel="V of the battery", ylabel="gf")
        axes.invert_xaxis()
        axes.legend(frameon=False)
    return figure
