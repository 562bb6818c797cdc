"""One landing, drawn: its log over its simulated draws, and the vehicle from the side, real and simulated."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from calibration.gap.landings.outcomes.labels import NONE
from calibration.gap.landings.outcomes.measured_motion import BEFORE, MeasuredMotion
from calibration.gap.landings.outcomes.simulated_motion import SimulatedMotion, quantiles
from calibration.gap.report.landing_side import draw_measured, draw_simulated
from calibration.gap.report.landing_style import CLASS_COLOURS, CLASS_LINES, CLASS_WORDS
from calibration.report_style import BLUE, INK, MUTED, TRIGGER, Margins, new_figure
from calibration.side_view import CEILING_M
from onboard.arrays import FloatArray
from onboard.vehicle import Vehicle

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_SIZE = (10.4, 4.6)
_SIDES = ((0.685, 0.523, 0.305, 0.377), (0.685, 0.081, 0.305, 0.377))
_STRIDE = 5
"""Steps of the simulation between two points that are drawn."""
_DEGREES = 180.0 / np.pi
_FRONT, _REAR = [0, 3], [1, 2]
_FONT = 8
_ON = {**CLASS_WORDS, NONE: "no leg"}
_ANY = (-np.inf, np.inf)
_MOST_RATE = (-40.0, 40.0)  # rad/s, beyond a gyro's 35
_MOST_FLIP = (-30.0, 270.0)
_ROOM = 0.2
"""m below the trigger that a height may go down to."""


@dataclass(frozen=True)
class ShownLanding:
    """What is drawn of one landing.

    Attributes:
        measured, simulated: its motion, real and simulated.
        start: m (3,), where the simulated draws start about. ceiling: m.
        vehicle: for its sizes. parameters: its physics.
    """

    measured: MeasuredMotion
    simulated: SimulatedMotion
    start: FloatArray
    ceiling: float
    vehicle: Vehicle
    parameters: Any

    @property
    def typical(self) -> dict[int, int]:
        """One draw for each way in which draws end, the most frequent way first."""
        classes = self.simulated.classes
        by_count = sorted(CLASS_WORDS, key=lambda one: -np.count_nonzero(classes == one))
        found = {one: self.simulated.typical(one) for one in by_count}
        return {one: draw for one, draw in found.items() if draw is not None}


class _Points(NamedTuple):
    """Measured samples (k,) in a panel, and whether their marks are filled."""

    t: FloatArray
    values: FloatArray
    filled: bool = True


class _Panel(NamedTuple):
    """A quantity over time: its draws (n, rows) each, its samples, and what limits are at most."""

    title: str
    most: tuple[float, float]
    draws: tuple[FloatArray, ...]
    points: tuple[_Points, ...]


def landing_figure(shown: ShownLanding) -> "Figure":
    """Six quantities over time, and the side views of what was measured and of a typical draw."""
    figure = new_figure(*_SIZE, Margins())
    last = float(shown.simulated.t[-1])
    for number, panel in enumerate(_panels(shown)):
        row, column = divmod(number, 2)
        axes = figure.add_axes((0.045 + 0.315 * column, 0.685 - 0.302 * row, 0.265, 0.215))
        _draw(axes, panel, shown)
        axes.set_xlim(-BEFORE, last)
        if row < 2:
            axes.tick_params(labelbottom=False)
        else:
            axes.set_xlabel("s after the trigger", fontsize=_FONT, labelpad=1)
    sides = [figure.add_axes(place) for place in _SIDES]
    draw_measured(sides[0], shown.measured, shown.simulated, shown.ceiling, shown.vehicle, shown.parameters)
    one, draw = next(iter(shown.typical.items()))
    draw_simulated(sides[1], shown.simulated, draw, shown.ceiling, shown.vehicle)
    sides[0].set_title("from the side, z over x (m): measured", fontsize=_FONT, loc="left", y=1.0, pad=3)
    sides[1].set_title(f"a simulated draw that ends on {_ON[one]}", fontsize=_FONT, loc="left", y=1.0, pad=3)
    _frame(sides, shown)
    _legend(figure, shown)
    return figure


def _panels(shown: ShownLanding) -> Iterator[_Panel]:
    measured, simulated = shown.measured, shown.simulated
    for axis, name in ((1, "pitch rate"), (0, "roll rate")):
        points = _Points(measured.gyro_t, measured.gyro[:, axis])
        yield _Panel(f"{name}, rad/s", _MOST_RATE, (simulated.rates[:, :, axis],), (points,))
    by_gyro = np.interp(measured.gyro_t, measured.turned_t, measured.turned_flip_angles, np.nan, np.nan)
    angles = (
        _Points(measured.pose_t, _DEGREES * measured.pose_flip_angles),
        _Points(measured.gyro_t, _DEGREES * by_gyro, filled=False),
    )
    yield _Panel(
        "flip angle, deg (open: gyro, added up)", _MOST_FLIP, (_DEGREES * simulated.flip_angles,), angles
    )
    pairs = tuple(1e3 * simulated.thrusts[:, :, pair].mean(axis=2) for pair in (_FRONT, _REAR))
    told = tuple(
        _Points(measured.thrust_t, 1e3 * measured.thrust[:, pair].mean(axis=1), pair is _FRONT)
        for pair in (_FRONT, _REAR)
    )
    yield _Panel("told a front motor, mN (open: a rear one)", _ANY, pairs, told)
    height = _Points(measured.pose_t, measured.pose[:, 6] - shown.ceiling)
    above = simulated.positions[:, :, 2] - shown.ceiling
    lowest = shown.start[2] - shown.ceiling - _ROOM
    yield _Panel("height against the ceiling, m", (lowest, 0.0), (above,), (height,))
    forward = _Points(measured.pose_t, measured.pose[:, 4] - shown.start[0])
    ahead = simulated.positions[:, :, 0] - shown.start[0]
    yield _Panel("forward since the trigger, m", _ANY, (ahead,), (forward,))


def _draw(axes: "Axes", panel: _Panel, shown: ShownLanding) -> None:
    t = shown.simulated.t[::_STRIDE]
    seen = [points.values for points in panel.points]
    for draws in panel.draws:
        low, middle, high = quantiles(draws[:, ::_STRIDE])
        seen += [low, high]
        axes.fill_between(t, low, high, color=MUTED, alpha=0.25, lw=0)
        axes.plot(t, middle, color=MUTED, lw=1.4)
        for one, draw in shown.typical.items():
            axes.plot(t, draws[draw, ::_STRIDE], CLASS_LINES[one], color=CLASS_COLOURS[one], lw=1.1)
    for points in panel.points:
        face = INK if points.filled else "white"
        axes.plot(points.t, points.values, "o", ms=2.6, mec=INK, mfc=face, mew=0.7, zorder=5)
    _mark(axes, shown)
    axes.set_ylim(*_limits(seen, panel.most))
    axes.set_title(panel.title, fontsize=_FONT, loc="left", y=1.0, pad=3)
    axes.tick_params(labelsize=7, length=2, pad=2)
    axes.locator_params(axis="y", nbins=4)


def _limits(seen: list[FloatArray], most: tuple[float, float]) -> tuple[float, float]:
    """Limits that hold samples and band, within `most`: what falls and tumbles must not flatten the rest."""
    known = np.concatenate(seen)
    known = known[np.isfinite(known)]
    if not known.size:
        return 0.0, 1.0
    low, high = max(float(known.min()), most[0]), min(float(known.max()), most[1])
    room = 0.06 * max(high - low, 1e-3)
    return low - room, high + room


def _mark(axes: "Axes", shown: ShownLanding) -> None:
    """Trigger, contact and the end of the horizon."""
    simulated = shown.simulated
    axes.axvline(0.0, color=TRIGGER, lw=0.9)
    first, _, last = simulated.first_contacts
    if np.isfinite(first):
        axes.axvspan(first, last, color=BLUE, alpha=0.22, lw=0)
    if shown.measured.contact is not None:
        axes.axvline(shown.measured.contact, color=INK, lw=0.9)
    axes.axvline(float(np.median(simulated.ends["duration"])), color=MUTED, lw=1.1, ls=(0, (1, 2)))


def _frame(sides: "list[Axes]", shown: ShownLanding) -> None:
    """Both side views alike: from the trigger to the ceiling, and as far ahead as the draws go."""
    reach = shown.vehicle.body.arm_x.value + 3.0 * shown.vehicle.body.propeller_radius.value
    high = shown.ceiling + 0.4 * CEILING_M
    height = high - shown.start[2] + reach
    width = height * _SIZE[0] * _SIDES[0][2] / (_SIZE[1] * _SIDES[0][3])
    ahead = float(np.median(shown.simulated.at_contact(shown.simulated.positions[:, :, 0])))
    middle = 0.5 * (shown.start[0] + (ahead if np.isfinite(ahead) else shown.start[0]))
    for axes in sides:
        axes.set(xlim=(middle - 0.5 * width, middle + 0.5 * width), ylim=(high - height, high))
        axes.set_aspect("equal")
        axes.tick_params(labelsize=7, length=2, pad=2)
        axes.locator_params(nbins=5)
    sides[0].tick_params(labelbottom=False)
    sides[1].set_xlabel("x, m", fontsize=_FONT, labelpad=1)


def _legend(figure: "Figure", shown: ShownLanding) -> None:
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    handles: dict[str, Any] = {
        "measured": Line2D([], [], marker="o", ls="", ms=3, color=INK),
        "draws: median, 10 to 90 %": Line2D([], [], color=MUTED, lw=4, alpha=0.5),
    }
    for one in shown.typical:
        handles[f"a draw: {CLASS_WORDS[one]}"] = Line2D(
            [], [], color=CLASS_COLOURS[one], ls=CLASS_LINES[one], lw=1.3
        )
    handles["trigger"] = Line2D([], [], color=TRIGGER, lw=1)
    if shown.measured.contact is not None:
        handles["contact"] = Line2D([], [], color=INK, lw=1)
    handles["of 80 % of draws"] = Patch(color=BLUE, alpha=0.25, lw=0)
    handles["feet counted"] = Line2D([], [], color=MUTED, ls=(0, (1, 2)), lw=1.2)
    figure.legend(
        list(handles.values()),
        list(handles),
        loc="upper left",
        bbox_to_anchor=(0.035, 1.01),
        ncols=len(handles),
        frameon=False,
        fontsize=7.5,
        columnspacing=1.2,
        handlelength=1.6,
        handletextpad=0.5,
    )
