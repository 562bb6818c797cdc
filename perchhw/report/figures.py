"""Figures of one flight. Each function gives inline SVG, or None when the flight lacks what it would show."""

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from calibration.flights import Flight
from calibration.report_style import BLUE, INK, MUTED, ORANGE, TRIGGER, Margins, new_figure, svg
from onboard.arrays import BoolArray, FloatArray
from onboard.rotation import to_matrices

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_DRAWN_HALF_LENGTH_M = 0.05


def draw_bodies(axes: "Axes", after: FloatArray, pose: FloatArray) -> None:
    """The fore-aft axis of the body every 40 ms around the trigger, and at rest; a dot marks the nose."""
    wanted = [*np.arange(-0.4, 0.401, 0.04), after[-1]]
    rows = sorted({int(np.argmin(np.abs(after - w))) for w in wanted if after[0] <= w <= after[-1]})
    forward = to_matrices(pose[rows, 3:])[:, :, 0] * _DRAWN_HALF_LENGTH_M
    for row, nose in zip(rows, forward, strict=True):
        x, z = pose[row, 0], pose[row, 2]
        axes.plot([x - nose[0], x + nose[0]], [z - nose[2], z + nose[2]], color=INK, lw=1.6, alpha=0.75)
        axes.plot(x + nose[0], z + nose[2], ".", ms=4, color=ORANGE)


def cues_over_time(flight: Flight) -> str | None:
    """tau and the trigger value towards the trigger."""
    if not flight.has("tau", "trigger_value"):
        return None
    figure = new_figure(5.2, 4.0, Margins())
    top, bottom = figure.subplots(2, 1, sharex=True)
    t0, window = _window(flight, 1.2, 0.3)
    t, tau = flight.series("tau")
    near = window(t) & (tau[:, 0] < 1.5) & (tau[:, 0] > 0.0)
    top.plot(t[near] - t0, tau[near, 0], ".-", color=BLUE, ms=3, lw=1)
    top.set(ylabel=r"$\tau$ (s)")
    t, value = flight.series("trigger_value")
    near = window(t)
    bottom.plot(t[near] - t0, value[near, 0], ".-", color=BLUE, ms=3, lw=1)
    bottom.axhline(0.0, color=MUTED, lw=1, ls="--")
    bottom.set(ylabel="trigger value", xlabel=_time_label(flight))
    _mark_trigger(flight, t0, top, bottom)
    return svg(figure, "Time to contact and trigger value; the policy fires at a value of 0")


def rates_in_flip(flight: Flight) -> str | None:
    """Body rates around the flip; of all the flight where there was none."""
    if not flight.has("gx", "gy", "gz"):
        return None
    t, rates = flight.series("gx", "gy", "gz")
    t0, window = _window(flight, 0.3, 1.2)
    near = window(t)
    figure = new_figure(5.2, 3.4, Margins())
    axes = figure.add_subplot()
    looks = zip("xyz", (MUTED, BLUE, ORANGE), (":", "-", "--"), strict=True)
    for k, (axis, colour, line) in enumerate(looks):
        axes.plot(t[near] - t0, rates[near, k], line, color=colour, lw=1.2, label=rf"$\omega_{axis}$")
    axes.set(xlabel=_time_label(flight), ylabel="rate (rad/s)")
    axes.legend(frameon=False, ncols=3)
    _mark_trigger(flight, t0, axes)
    around = "" if flight.trigger is None else " around the flip"
    return svg(figure, f"Body rates about the three axes{around}")


def _window(flight: Flight, before: float, after: float) -> tuple[float, Callable[[FloatArray], BoolArray]]:
    """The time that a figure calls zero, and which times it shows (all of a flight without a trigger)."""
    if flight.trigger is None:
        return float(flight.t[0]), lambda t: np.ones(t.shape, dtype=np.bool_)
    zero = flight.trigger.t
    return zero, lambda t: (t >= zero - before) & (t <= zero + after)


def _time_label(flight: Flight) -> str:
    return "time from start (s)" if flight.trigger is None else "time from trigger (s)"


def _mark_trigger(flight: Flight, t0: float, *panels: "Axes") -> None:
    if flight.trigger is not None:
        for axes in panels:
            axes.axvline(flight.trigger.t - t0, color=TRIGGER, lw=1.2)
