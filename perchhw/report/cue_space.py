"""The space of augmented optical flow, OF_a = (tau, theta_x, d_ceil): pairs, trigger region, approaches.

Paper, figures of landing success (b), trigger policy region and flight trajectories.
"""

from typing import TYPE_CHECKING, Any

import numpy as np

from calibration.flights import Flight
from calibration.report_style import INK, TRIGGER, new_figure
from onboard.arrays import FloatArray
from onboard.policy.files import Policy
from onboard.policy.trigger import trigger_values
from perchhw.learning.results import columns
from perchhw.learning.sweep_folder import Row
from perchhw.report.isosurface import zero_surface
from perchhw.report.rate_maps import GOOD_RATE, RATE_COLOURS

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

TAU_LABEL, FLOW_LABEL, DISTANCE_LABEL = r"$\tau$ (s)", r"$\theta_x$ (rad/s)", r"$d_{ceil}$ (m)"
REGION_COLOUR = "#8c6bb1"
PATH_COLOUR = "#d1495b"
_SURFACE_POINTS = 36
_LIGHT = np.array([0.64, 0.48, 0.6])
"""Direction to the light in tau, theta_x, d_ceil, each in units of the box."""
_SLICE_POINTS = 160
_SLABS = 4
_MARGIN = 0.35
"""Of the drawn region around the pairs, in their standard deviations; at least the region itself."""


def pairs_in_space(pairs: tuple[Row, ...]) -> "Figure":
    """Pairs in velocity space and in OF_a, coloured by landing rate."""
    tau, flow, distance, rate = columns(pairs, "tau", "theta_x", "d_ceil", "landing_rate")
    figure, views = _two_views(10.6, 4.1, second=0.46)
    spaces = (
        ((flow * distance, distance / tau, distance), (r"$v_x$ (m/s)", r"$v_z$ (m/s)", DISTANCE_LABEL)),
        ((flow, tau, distance), (FLOW_LABEL, TAU_LABEL, DISTANCE_LABEL)),
    )
    dots: Any = None
    order = np.argsort(rate)
    for k, (axes, (coordinates, labels)) in enumerate(zip(views, spaces, strict=True)):
        dots = axes.scatter(
            *(c[order] for c in coordinates), c=rate[order], s=11, cmap=RATE_COLOURS, vmin=0.0, vmax=1.0,
            depthshade=False, edgecolors="white", linewidths=0.2, rasterized=True,
        )  # fmt: skip
        _label(axes, labels)
        axes.view_init(elev=20, azim=-60)
        title = "(a) velocity space" if k == 0 else "(b) optical-flow space"
        axes.text2D(0.03, 0.88, title, transform=axes.transAxes, fontsize=10.5)
    figure.colorbar(dots, cax=figure.add_axes((0.925, 0.18, 0.012, 0.64)), label="landing rate")
    return figure


def _two_views(width: float, height: float, second: float, **options: Any) -> tuple["Figure", list[Any]]:
    """A figure with two 3-D axes at places of their own, as the layout engine does not know their labels.

    `second` is the left end of the second one, as a share of the width.
    """
    figure = new_figure(width, height)
    figure.set_layout_engine("none")
    places = ((0.0, -0.03, 0.43, 1.08), (second, -0.03, 0.43, 1.08))
    return figure, [figure.add_axes(place, projection="3d", **options) for place in places]


def _label(axes: Any, labels: tuple[str, str, str]) -> None:
    from matplotlib.ticker import MaxNLocator

    for axis, label in zip((axes.xaxis, axes.yaxis, axes.zaxis), labels, strict=True):
        axis.set_label_text(label)
        axis.set_pane_color((0.975, 0.98, 0.985, 1.0))
        axis._axinfo["grid"]["color"] = "#dfe3e7"
        axis.set_major_locator(MaxNLocator(5))
    axes.tick_params(labelsize=8, pad=1)
    axes.set_box_aspect((1.0, 1.0, 0.8), zoom=0.98)


def region_bounds(policy: Policy, pairs: tuple[Row, ...]) -> FloatArray:
    """A box (3, 2) of tau, theta_x, d_ceil that holds the good pairs and the region around them."""
    states = np.column_stack(columns(_good(pairs), "tau", "theta_x", "d_ceil"))
    spread = _MARGIN * np.asarray(policy.scaler_std, np.float64)
    low, high = states.min(axis=0) - spread, states.max(axis=0) + spread
    low[0], high[0] = min(low[0], policy.tau_min), max(high[0], policy.tau_max)
    return np.column_stack([np.maximum(low, [0.0, low[1], 1e-3]), high])


def _good(pairs: tuple[Row, ...]) -> tuple[Row, ...]:
    good = tuple(
        row for row in pairs if float(row["landing_rate"] or 0.0) >= GOOD_RATE and row["tau"] is not None
    )
    return good or tuple(row for row in pairs if row["tau"] is not None)


def _trigger_grid(policy: Policy, axes: tuple[FloatArray, FloatArray, FloatArray]) -> FloatArray:
    """The trigger value on a grid of tau, theta_x, d_ceil, (p, q, r)."""
    states = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    values = trigger_values(policy.compiled(), states.astype(np.float32))
    return np.asarray(values, np.float64).reshape([len(axis) for axis in axes])


def trigger_surface(policy: Policy, bounds: FloatArray, points: int = _SURFACE_POINTS) -> FloatArray:
    """Triangles (n, 3, 3) in tau, theta_x, d_ceil of the surface on which the policy begins to fire."""
    tau, flow, distance = (np.linspace(low, high, points) for low, high in bounds)
    axes = (tau, flow, distance)
    return zero_surface(_trigger_grid(policy, axes), axes)


def region_with_approach(pairs: tuple[Row, ...], policy: Policy, flight: Flight | None) -> "Figure":
    """The trigger surface around the good pairs from two sides, and an approach until it fires."""
    from matplotlib.patches import Patch
    from mpl_toolkits.mplot3d.art3d import Poly3DCollection

    bounds = region_bounds(policy, pairs)
    triangles = trigger_surface(policy, bounds)
    colours = _shaded(triangles, bounds)
    tau, flow, distance = columns(_good(pairs), "tau", "theta_x", "d_ceil")
    figure, views = _two_views(10.6, 4.8, second=0.54, computed_zorder=False)
    for axes, azimuth in zip(views, (-60, 30), strict=True):
        axes.scatter(
            flow, tau, distance, s=7, color=INK, alpha=0.55, linewidths=0, zorder=1, rasterized=True,
            label=f"pairs with a landing rate of {GOOD_RATE:g} or more",
        )  # fmt: skip
        surface = Poly3DCollection(
            triangles[:, :, [1, 0, 2]], alpha=0.3, facecolors=colours, linewidths=0, zorder=2, rasterized=True
        )
        axes.add_collection3d(surface)
        axes.set_xlim(*bounds[1])
        axes.set_ylim(*bounds[0])
        axes.set_zlim(*bounds[2])
        if flight is not None:
            _draw_path(axes, flight, bounds)
        _label(axes, (FLOW_LABEL, TAU_LABEL, DISTANCE_LABEL))
        axes.view_init(elev=20, azim=azimuth)
    handles, labels = figure.axes[0].get_legend_handles_labels()
    handles.append(Patch(color=REGION_COLOUR, alpha=0.4))
    labels.append("trigger region")
    figure.legend(handles, labels, loc="lower center", ncols=4, frameon=False)
    return figure


def _shaded(triangles: FloatArray, bounds: FloatArray) -> FloatArray:
    """Colours (n, 4) of triangles in the box: darker where they face away from the light."""
    from matplotlib.colors import to_rgba

    corners = triangles / (bounds[:, 1] - bounds[:, 0])
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    lengths = np.linalg.norm(normals, axis=1, keepdims=True)
    facing = np.abs(normals / np.where(lengths > 0.0, lengths, 1.0) @ _LIGHT)
    colours = np.tile(to_rgba(REGION_COLOUR), (len(triangles), 1))
    colours[:, :3] *= 0.45 + 0.55 * facing[:, None]
    return colours


def _draw_path(axes: Any, flight: Flight, bounds: FloatArray) -> None:
    """The cues of an approach within the bounds, in front of everything, and where it fired."""
    cues = approach_cues(flight)
    inside = np.all((cues >= bounds[:, 0]) & (cues <= bounds[:, 1]), axis=1)
    cues = cues[inside]
    axes.plot(cues[:, 1], cues[:, 0], cues[:, 2], color=PATH_COLOUR, lw=2.2, zorder=4, label="approach")
    at = trigger_cues(flight)
    if at is not None:
        axes.plot(
            [at[1]], [at[0]], [at[2]], "o", ms=8, mfc="white", mec=TRIGGER, mew=2.2, zorder=5,
            label="trigger",
        )  # fmt: skip


def approach_cues(flight: Flight) -> FloatArray:
    """(n, 3) tau, theta_x, d_ceil of a flight until its trigger, or the ceiling without one."""
    t, cues = flight.series("tau", "theta_x", "d_ceil")
    last = t[int(np.argmin(cues[:, 2]))] if flight.trigger is None else flight.trigger.t
    used = (cues[:, 0] > 0.0) & (t <= last)
    return cues[used]


def trigger_cues(flight: Flight) -> FloatArray | None:
    """(3,) tau, theta_x, d_ceil that fired the flip, as the policy saw them."""
    if flight.trigger is None:
        return None
    snapshot = flight.trigger.snapshot
    if {"tau", "theta_x", "d_ceil"} <= snapshot.keys():
        return np.array([snapshot[name] for name in ("tau", "theta_x", "d_ceil")])
    return approach_cues(flight)[-1]


def region_slices(pairs: tuple[Row, ...], policy: Policy, flight: Flight | None) -> "Figure":
    """Cuts through the trigger region at several distances, with the pairs near each.

    The pairs are split into slabs of equal number by their distance; a cut is at the middle one of its slab.
    """
    tau, flow, distance, rate = columns(pairs, "tau", "theta_x", "d_ceil", "landing_rate")
    bounds = region_bounds(policy, pairs)
    for k, values in enumerate((tau, flow)):
        bounds[k] = min(bounds[k, 0], values.min()), max(bounds[k, 1], values.max())
        bounds[k] += np.array([-0.04, 0.04]) * (bounds[k, 1] - bounds[k, 0])
    edges = np.quantile(distance, np.linspace(0.0, 1.0, _SLABS + 1))
    figure = new_figure(10.6, 3.3)
    panels = figure.subplots(1, _SLABS, sharex=True, sharey=True)
    dots: Any = None
    for k, axes in enumerate(panels):
        low, high = edges[k], edges[k + 1]
        near = (distance >= low) & ((distance < high) | (k == _SLABS - 1))
        cut = float(np.median(distance[near]))
        _draw_cut(axes, policy, bounds, cut)
        dots = axes.scatter(
            tau[near], flow[near], c=rate[near], s=13, cmap=RATE_COLOURS, vmin=0.0, vmax=1.0,
            edgecolors="white", linewidths=0.3, zorder=3,
        )  # fmt: skip
        if flight is not None:
            _mark_passage(axes, flight, low, high)
        axes.set_title(f"{low:.2f} to {high:.2f} m, cut at {cut:.2f} m", fontsize=9)
        axes.set(xlabel=TAU_LABEL)
    panels[0].set(ylabel=FLOW_LABEL, xlim=bounds[0][::-1], ylim=bounds[1])
    figure.colorbar(dots, ax=panels, pad=0.01, label="landing rate")
    return figure


def _draw_cut(axes: "Axes", policy: Policy, bounds: FloatArray, distance: float) -> None:
    """The trigger region at one distance, shaded, with its border."""
    tau, flow = (np.linspace(low, high, _SLICE_POINTS) for low, high in bounds[:2])
    values = _trigger_grid(policy, (tau, flow, np.array([distance])))[:, :, 0].T
    if values.max() < 0.0:
        return
    axes.contourf(tau, flow, values, levels=[0.0, np.inf], colors=[REGION_COLOUR], alpha=0.2, zorder=1)
    axes.contour(tau, flow, values, levels=[0.0], colors=[REGION_COLOUR], linewidths=1.4, zorder=2)


def _mark_passage(axes: "Axes", flight: Flight, low: float, high: float) -> None:
    """Where an approach passes these distances, and its trigger when it is among them."""
    cues = approach_cues(flight)
    near = (cues[:, 2] >= low) & (cues[:, 2] <= high)
    axes.plot(cues[:, 0], cues[:, 1], color=PATH_COLOUR, lw=1, alpha=0.45, zorder=4)
    axes.plot(cues[near, 0], cues[near, 1], ".-", color=PATH_COLOUR, lw=2, ms=5, zorder=4)
    at = trigger_cues(flight)
    if at is not None and low <= at[2] <= high:
        axes.plot(at[0], at[1], "o", ms=8, mfc="none", mec=TRIGGER, mew=2.2, zorder=5)
