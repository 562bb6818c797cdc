"""A landing from the side: the vehicle at a few instants, as it was measured and as it was simulated."""

from typing import TYPE_CHECKING, Any

import numpy as np

from calibration.gap.data.rotations import matrices
from calibration.gap.landings.kernels import COLUMNS, QUATERNION
from calibration.gap.landings.outcomes.measured_motion import MeasuredMotion
from calibration.gap.landings.outcomes.simulated_motion import AFTER_CONTACT, SimulatedMotion
from calibration.gap.landings.problem import highest
from calibration.report_style import BLUE, INK, MUTED
from calibration.side_view import CEILING, CEILING_M, draw_drone
from onboard.arrays import FloatArray
from onboard.vehicle import Vehicle

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_STRENGTHS = (0.6, 0.25, 1.0, 0.5)
"""How dark the vehicle is at the trigger, half of the way, at the contact, and where its feet are counted."""
_UNTOUCHED = (0.0, 0.1, 0.2, 0.3)
"""s, instants of what never touches."""
_CLOSE = 0.012
"""s between an instant and the pose that stands for it, at most."""


def draw_simulated(
    axes: "Axes", simulated: SimulatedMotion, draw: int, ceiling: float, vehicle: Vehicle
) -> None:
    """One draw."""
    contact = simulated.contacts[draw]
    place, attitude = simulated.positions[draw], simulated.quaternions[draw]
    _ceiling(axes, ceiling)
    rows = [int(np.argmin(np.abs(simulated.t - when))) for when in _instants(contact)]
    axes.plot(place[: rows[-1], 0], place[: rows[-1], 2], color=BLUE, lw=0.9)
    for row, alpha in zip(rows, _STRENGTHS, strict=True):
        draw_drone(axes, place[row, [0, 2]], matrices(attitude[row : row + 1])[0], vehicle, alpha)


def draw_measured(
    axes: "Axes",
    measured: MeasuredMotion,
    simulated: SimulatedMotion,
    ceiling: float,
    vehicle: Vehicle,
    parameters: Any,
) -> None:
    """What the log shows: its poses; without poses the attitude at the contact by the gyro.

    The height there is known, since something touches the ceiling. The place along it is not: the vehicle
    stands where the draws have theirs, and the picture says so.
    """
    _ceiling(axes, ceiling)
    axes.plot(measured.pose[:, 4], measured.pose[:, 6], ".", color=BLUE, ms=2.5)
    contact = np.nan if measured.contact is None else measured.contact
    for when, alpha in zip(_instants(contact), _STRENGTHS, strict=True):
        row = _nearest(measured.pose_t, when)
        if row is not None:
            pose = measured.pose[row]
            rotation = matrices(pose[None, :4])[0]
            draw_drone(axes, pose[[4, 6]], rotation, vehicle, alpha)
        elif when == contact and measured.turned_t[-1] > contact - _CLOSE:
            _touching(axes, measured.turned[-1], simulated, ceiling, vehicle, parameters)


def _touching(
    axes: "Axes",
    attitude: FloatArray,
    simulated: SimulatedMotion,
    ceiling: float,
    vehicle: Vehicle,
    parameters: Any,
) -> None:
    """The vehicle with an attitude (4,), its highest point at the ceiling."""
    row = np.zeros(COLUMNS)
    row[QUATERNION : QUATERNION + 4] = attitude
    x = float(np.nanmedian(simulated.at_contact(simulated.positions[:, :, 0])))
    place = np.array([x, ceiling - highest(parameters, row)])
    draw_drone(axes, place, matrices(attitude[None])[0], vehicle)
    axes.annotate(
        "attitude by gyro,\nx not measured",
        (place[0], place[1]),
        xytext=(0, -26),
        textcoords="offset points",
        fontsize=6.5,
        color=INK,
        ha="center",
        va="top",
    )


def _instants(contact: float) -> tuple[float, ...]:
    """When the vehicle is drawn (s), as _STRENGTHS says."""
    return (0.0, 0.5 * contact, contact, contact + AFTER_CONTACT) if np.isfinite(contact) else _UNTOUCHED


def _nearest(t: FloatArray, when: float) -> int | None:
    """Row of the sample nearest to a time; None where there is none close."""
    if not t.size:
        return None
    row = int(np.argmin(np.abs(t - when)))
    return row if abs(t[row] - when) < _CLOSE else None


def _ceiling(axes: "Axes", ceiling: float) -> None:
    axes.axhspan(ceiling, ceiling + CEILING_M, color=CEILING, lw=0)
    axes.axhline(ceiling, color=MUTED, lw=0.6)
