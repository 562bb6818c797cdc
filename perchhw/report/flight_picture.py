"""The picture that a flight's report opens with: its path, and the drone at the instants that count."""

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from calibration.flights import Flight
from calibration.report_style import BLUE, INK, TRIGGER, Margins, by_width, new_figure
from calibration.side_view import CEILING, CEILING_M, draw_drone
from onboard.app_interface import LandingState
from onboard.arrays import BoolArray
from onboard.rotation import to_matrices
from onboard.vehicle import Vehicle

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_ZOOM_BEFORE_S, _ZOOM_AFTER_S = 0.03, 0.3
_GHOST_S = 0.04
"""Time between the drones drawn faintly in the close view."""
_MARGINS = Margins(top=0.28, between=0.16)


class Instant(NamedTuple):
    """What happened at an instant of a flight, in words, and its time (s)."""

    words: str
    t: float


def instants(flight: Flight, touch_t: float | None) -> list[Instant]:
    """When the drone is drawn, in order; `touch_t` (s) is that of the first blow, if known."""
    found: list[Instant] = []
    if flight.has("landing_state"):
        t, state = flight.series("landing_state")
        begun = t[state[:, 0] == LandingState.APPROACH]
        if begun.size:
            found.append(Instant("start of the approach", float(begun[0])))
    if flight.trigger is not None:
        found.append(Instant("trigger", flight.trigger.t))
        cut = _first_state(flight, LandingState.CUT)
        if cut is not None:
            found.append(Instant("motors cut", cut))
    if touch_t is not None:
        found.append(Instant("first touch", touch_t))
    t, _ = flight.series("z")
    return [*sorted(found, key=lambda instant: instant.t), Instant("end of the record", float(t[-1]))]


def _first_state(flight: Flight, wanted: LandingState) -> float | None:
    if not flight.has("landing_state"):
        return None
    t, state = flight.series("landing_state")
    hits = t[state[:, 0] == wanted]
    return float(hits[0]) if hits.size else None


def flight_picture(flight: Flight, vehicle: Vehicle | None, touch_t: float | None) -> str | None:
    """Path in x and z under the ceiling with the drone at its instants, as inline SVG; None without poses."""
    if not flight.has("x", "z", "qw"):
        return None
    shown = instants(flight, touch_t)
    words = ", ".join(f"{number} {instant.words}" for number, instant in enumerate(shown, start=1))
    alt = f"Side view of the path under the ceiling with the drone at: {words}"
    return by_width(lambda broad: _drawn(flight, vehicle, shown, broad), alt)


def _drawn(flight: Flight, vehicle: Vehicle | None, shown: list[Instant], broad: bool) -> "Figure":
    zoomed = flight.trigger is not None
    size = (10.4, 3.9) if broad else (5.2, 7.4 if zoomed else 3.6)
    figure = new_figure(*size, _MARGINS)
    if not zoomed:
        panels = [figure.add_subplot()]
    elif broad:
        panels = list(figure.subplots(1, 2, width_ratios=(1.45, 1.0)))
    else:
        panels = list(figure.subplots(2, 1, height_ratios=(0.8, 1.0)))
    _path(panels[0], flight, vehicle, shown)
    panels[0].set_title("the flight", loc="left", fontsize=10)
    if zoomed:
        _path(panels[1], flight, vehicle, shown, _near_ceiling(flight, shown))
        panels[1].set_title("at the ceiling", loc="left", fontsize=10)
    return figure


def _near_ceiling(flight: Flight, shown: list[Instant]) -> BoolArray:
    """Which poses the close view shows: from shortly before the motors are cut until the body is caught."""
    t, _ = flight.series("z")
    late = [instant.t for instant in shown[:-1] if instant.words in ("motors cut", "first touch")]
    begin = min(late, default=0.0 if flight.trigger is None else flight.trigger.t) - _ZOOM_BEFORE_S
    return (t > begin) & (t < begin + _ZOOM_BEFORE_S + _ZOOM_AFTER_S)


def _path(
    axes: "Axes",
    flight: Flight,
    vehicle: Vehicle | None,
    shown: list[Instant],
    near: BoolArray | None = None,
) -> None:
    t, pose = flight.series("x", "y", "z", "qx", "qy", "qz", "qw")
    if near is not None:
        t, pose = t[near], pose[near]
    if not t.size:
        return
    axes.plot(pose[:, 0], pose[:, 2], color=BLUE, lw=1.3, label="path")
    if flight.ceiling_z is not None:
        z = flight.ceiling_z
        axes.axhspan(z, z + CEILING_M, color=CEILING, lw=0)
        across = axes.get_yaxis_transform()
        axes.text(
            0.0,
            z + CEILING_M / 2,
            f" ceiling {z:.2f} m",
            va="center",
            fontsize=8,
            color=INK,
            transform=across,
        )
    if near is not None and vehicle is not None:
        for wanted in np.arange(t[0], t[-1], _GHOST_S):
            k = int(np.argmin(np.abs(t - wanted)))
            draw_drone(axes, pose[k, [0, 2]], to_matrices(pose[k : k + 1, 3:].copy())[0], vehicle, 0.18)
    for number, instant in enumerate(shown, start=1):
        if not t[0] <= instant.t <= t[-1]:
            continue
        k = int(np.argmin(np.abs(t - instant.t)))
        rotation = to_matrices(pose[k : k + 1, 3:].copy())[0]
        place = pose[k, [0, 2]]
        if vehicle is not None:
            draw_drone(axes, place, rotation, vehicle)
        colour = TRIGGER if instant.words == "trigger" else INK
        axes.annotate(
            str(number), (place[0], place[1]), xytext=(-15, 7), textcoords="offset points", color=colour,
            fontsize=9, fontweight="bold", zorder=7,
            bbox={"boxstyle": "round,pad=0.1", "fc": "white", "ec": "none", "alpha": 0.8},
        )  # fmt: skip
        axes.plot(*place, "D" if instant.words == "trigger" else ".", color=colour, ms=5, zorder=6)
    axes.set_aspect("equal", adjustable="datalim")
    axes.set(xlabel="x (m)", ylabel="z (m)")
