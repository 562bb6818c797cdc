"""One approach in space and in its cues (paper, figure of experimental trajectories)."""

from typing import TYPE_CHECKING

import numpy as np

from calibration.flights import Flight
from calibration.report_style import BLUE, GREEN, MUTED, TRIGGER, new_figure
from perchhw.report.figures import draw_bodies

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_BEFORE_S, _AFTER_S = 0.5, 1.0
"""Time around the trigger that the path shows."""
_NEAR_TOP_M = 0.005
_CUES_AFTER_S = 0.06
"""Cues mean nothing once the drone has flipped."""


def approach_views(flight: Flight) -> "Figure":
    """Side view near the ceiling, and tau and trigger value until the flip.

    Without a trigger, time counts from the first moment near the highest point. What the flight lacks stays
    empty.
    """
    figure = new_figure(10.6, 3.9)
    grid = figure.add_gridspec(2, 2, width_ratios=(1.15, 1.0))
    space = figure.add_subplot(grid[:, 0])
    top = figure.add_subplot(grid[0, 1])
    bottom = figure.add_subplot(grid[1, 1], sharex=top)
    zero = _zero(flight)
    _draw_path(space, flight, zero)
    for axes, name, label in ((top, "tau", r"$\tau$ (s)"), (bottom, "trigger_value", "trigger value")):
        if flight.has(name):
            t, values = flight.series(name)
            near = (t >= zero - _BEFORE_S) & (t <= zero + _CUES_AFTER_S)
            axes.plot(t[near] - zero, values[near, 0], ".-", color=BLUE, ms=4, lw=1.2)
        if flight.trigger is not None:
            axes.axvline(0.0, color=TRIGGER, lw=1.2)
        axes.set_ylabel(label)
    top.tick_params(labelbottom=False)
    bottom.axhline(0.0, color=MUTED, lw=1, ls="--")
    bottom.set_xlabel(
        "time from the highest point (s)" if flight.trigger is None else "time from trigger (s)"
    )
    return figure


def _zero(flight: Flight) -> float:
    """The time that the figure calls zero: the trigger, else the first arrival at the top."""
    if flight.trigger is not None:
        return flight.trigger.t
    t, z = flight.series("z")
    return float(t[int(np.argmax(z[:, 0] > z[:, 0].max() - _NEAR_TOP_M))])


def _draw_path(axes: "Axes", flight: Flight, zero: float) -> None:
    """The path around the trigger with the body and the ceiling."""
    axes.set(xlabel="x (m)", ylabel="z (m)", aspect="equal")
    if not flight.has("x", "z", "qw"):
        return
    t, pose = flight.series("x", "y", "z", "qx", "qy", "qz", "qw")
    near = (t >= zero - _BEFORE_S) & (t <= zero + (_AFTER_S if flight.trigger is not None else 0.0))
    t, pose = t[near], pose[near]
    axes.plot(pose[:, 0], pose[:, 2], color=BLUE, lw=1.3, label="path")
    draw_bodies(axes, t - zero, pose)
    if flight.trigger is not None:
        k = int(np.argmin(np.abs(t - zero)))
        axes.plot(pose[k, 0], pose[k, 2], "o", ms=7, color=TRIGGER, zorder=5, label="trigger")
    axes.plot(pose[-1, 0], pose[-1, 2], "s", ms=5, color=GREEN, zorder=5, label="end")
    axes.margins(0.08)
    if flight.ceiling_z is not None:
        axes.axhspan(flight.ceiling_z, flight.ceiling_z + 0.04, color="#c9ced4", lw=0, label="ceiling")
    axes.legend(frameon=False, fontsize=8, loc="upper left", bbox_to_anchor=(1.0, 1.0))
