"""Figures of one flight. Each function gives inline SVG, or None when the flight lacks what it would show."""

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from calibration.flights import Flight, Trigger
from onboard.arrays import BoolArray, FloatArray
from onboard.rotation import to_matrices
from perchhw.report.style import BLUE, GREEN, INK, MUTED, ORANGE, TRIGGER, new_figure, svg

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_APPROACH_S = 2.5
_DRAWN_HALF_LENGTH_M = 0.05


def side_view(flight: Flight, ceiling_z: float | None) -> str | None:
    """Path in x and z with the ceiling, the body drawn as a stroke around the trigger."""
    if not flight.has("x", "z", "qw"):
        return None
    t, pose = flight.series("x", "y", "z", "qx", "qy", "qz", "qw")
    figure = new_figure(10.4, 3.5)
    axes = figure.add_subplot()
    axes.plot(pose[:, 0], pose[:, 2], color=BLUE, lw=1.3, label="path")
    if ceiling_z is not None:
        x = (pose[:, 0].min() - 0.2, pose[:, 0].max() + 0.2)
        axes.fill_between(x, ceiling_z, ceiling_z + 0.07, color="#c9ced4", lw=0)
        axes.text(x[0], ceiling_z + 0.035, f" ceiling {ceiling_z:.3f} m", va="center", color=INK, fontsize=8)
    if flight.trigger is not None:
        draw_bodies(axes, t - flight.trigger.t, pose)
        k = int(np.argmin(np.abs(t - flight.trigger.t)))
        axes.plot(pose[k, 0], pose[k, 2], "o", ms=6, color=TRIGGER, zorder=5, label="trigger")
    axes.plot(pose[-1, 0], pose[-1, 2], "s", ms=5, color=GREEN, zorder=5, label="end")
    axes.set_aspect("equal")
    axes.set(xlabel="x (m)", ylabel="z (m)")
    axes.set_ylim(bottom=min(0.0, pose[:, 2].min()))
    axes.legend(loc="center left", bbox_to_anchor=(1.01, 0.5), frameon=False)
    return svg(figure)


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
    figure = new_figure(5.2, 4.0)
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
    return svg(figure)


def optical_flow_path(flight: Flight) -> str | None:
    """The way through optical-flow space: tau and theta_x, coloured by the distance to the ceiling."""
    if not flight.has("tau", "theta_x", "d_ceil"):
        return None
    t, cues = flight.series("tau", "theta_x", "d_ceil")
    near = (cues[:, 0] > 0.0) & (cues[:, 0] < 1.0)
    if flight.trigger is not None:
        near &= (t <= flight.trigger.t + 0.02) & (t > flight.trigger.t - _APPROACH_S)
    if not near.any():
        return None
    figure = new_figure(5.2, 4.0)
    axes = figure.add_subplot()
    axes.plot(cues[near, 0], cues[near, 1], color="#c9ced4", lw=1, zorder=1)
    dots = axes.scatter(cues[near, 0], cues[near, 1], c=cues[near, 2], s=12, cmap="viridis", zorder=2)
    figure.colorbar(dots, ax=axes, label=r"$d_{ceil}$ (m)")
    if flight.trigger is not None:
        tau, flow = (_at_trigger(flight, flight.trigger, name) for name in ("tau", "theta_x"))
        axes.plot(tau, flow, "o", ms=8, mfc="none", mec=TRIGGER, mew=2, zorder=3, label="trigger")
        axes.legend(frameon=False)
    axes.set(xlabel=r"$\tau$ (s)", ylabel=r"$\theta_x$ (1/s)")
    axes.invert_xaxis()
    return svg(figure)


def rates_in_flip(flight: Flight) -> str | None:
    """Body rates around the flip."""
    if not flight.has("gx", "gy", "gz"):
        return None
    t, rates = flight.series("gx", "gy", "gz")
    t0, window = _window(flight, 0.3, 1.2)
    near = window(t)
    figure = new_figure(5.2, 3.4)
    axes = figure.add_subplot()
    for k, (axis, colour) in enumerate(zip("xyz", (MUTED, BLUE, ORANGE), strict=True)):
        axes.plot(t[near] - t0, rates[near, k], color=colour, lw=1.2, label=rf"$\omega_{axis}$")
    axes.set(xlabel=_time_label(flight), ylabel="rate (rad/s)")
    axes.legend(frameon=False, ncols=3)
    _mark_trigger(flight, t0, axes)
    return svg(figure)


def battery(flight: Flight) -> str | None:
    """Battery voltage over the flight."""
    if not flight.has("vbat"):
        return None
    t, volts = flight.series("vbat")
    figure = new_figure(5.2, 3.4)
    axes = figure.add_subplot()
    t0 = flight.t[0] if flight.trigger is None else flight.trigger.t
    axes.plot(t - t0, volts[:, 0], color=GREEN, lw=1)
    axes.set(xlabel=_time_label(flight), ylabel="battery (V)")
    _mark_trigger(flight, t0, axes)
    return svg(figure)


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


def _at_trigger(flight: Flight, trigger: Trigger, name: str) -> float:
    """The channel at the trigger: from the snapshot, else the last sample before it."""
    if name in trigger.snapshot:
        return trigger.snapshot[name]
    t, values = flight.series(name)
    return float(values[max(0, int(np.searchsorted(t, trigger.t, side="right")) - 1), 0])
