"""A vehicle and its ceiling from the side, to scale, as pictures of reports show them."""

from typing import TYPE_CHECKING

import numpy as np

from calibration.report_style import INK, MUTED
from onboard.arrays import FloatArray
from onboard.vehicle import Vehicle

if TYPE_CHECKING:
    from matplotlib.axes import Axes

CEILING = "#c9ced4"
"""Colour of a ceiling."""
CEILING_M = 0.06
"""Thickness of the drawn ceiling."""


def draw_drone(
    axes: "Axes", place: FloatArray, rotation: FloatArray, vehicle: Vehicle, alpha: float = 1.0
) -> None:
    """The drone from its side, to scale: hull, the two visible rotors, fore (thick) and hind legs.

    Args:
        axes: of x and z.
        place: x and z of its origin (m), shape (2,).
        rotation: body to world, shape (3, 3).
        vehicle: for its sizes.
        alpha: 1 for a drone in ink, less for a faint one.
    """
    body, legs = vehicle.body, vehicle.legs
    half, top, bottom = body.body_half_x.value, body.body_top_z.value, body.body_bottom_z.value
    hull = np.array([(-half, bottom), (half, bottom), (half, top), (-half, top), (-half, bottom)])
    axes.fill(*_world(hull, place, rotation), color=INK, alpha=0.8 * alpha, lw=0, zorder=4)
    height, arm, radius = body.propeller_height_z.value, body.arm_x.value, body.propeller_radius.value
    axes.plot(
        *_world(np.array([(-arm, 0.0), (arm, 0.0)]), place, rotation),
        color=INK,
        alpha=alpha,
        lw=1.0,
        zorder=4,
    )
    for side in (1.0, -1.0):
        rotor = np.array([(side * arm - radius, height), (side * arm + radius, height)])
        axes.plot(*_world(rotor, place, rotation), color=MUTED, alpha=alpha, lw=1.4, zorder=4)
        if legs is None:
            continue
        reach = legs.length.value * np.sin(legs.angle) / np.sqrt(2.0)
        hip = (side * legs.hip_x.value, legs.hip_z.value)
        foot = (side * (legs.hip_x.value + reach), legs.hip_z.value - legs.length.value * np.cos(legs.angle))
        axes.plot(
            *_world(np.array([hip, foot]), place, rotation),
            color=INK,
            alpha=alpha,
            lw=1.8 if side > 0.0 else 0.9,
            zorder=4,
        )


def _world(points: FloatArray, place: FloatArray, rotation: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Points (n, 2) of body x and z in the world's x and z."""
    x = place[0] + points[:, 0] * rotation[0, 0] + points[:, 1] * rotation[0, 2]
    z = place[1] + points[:, 0] * rotation[2, 0] + points[:, 1] * rotation[2, 2]
    return x, z
