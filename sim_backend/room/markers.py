"""Markers in a simulated room: those of a body, and reflections that belong to none."""

import math

from mocap_bridge.rotation import rotate
from onboard.arrays import Vector
from sim_backend.room.feed import TruePose

MARKER_RADIUS = 3.2e-3
"""Of the small balls that a Crazyflie carries, m (6.4 mm across, as Vicon sells them)."""
LAYOUT: tuple[Vector, ...] = (
    (0.031, 0.004, 0.022),
    (-0.024, 0.029, 0.018),
    (-0.029, -0.021, 0.020),
    (0.008, -0.033, 0.030),
)
"""Where a body carries its markers, m, in its own axes: no two distances are alike, so it fits one way."""


def markers_of(pose: TruePose) -> tuple[Vector, ...]:
    """Where the markers of a body are, m, world."""
    x, y, z = pose.position
    offsets = (rotate(pose.quaternion, offset) for offset in LAYOUT)
    return tuple((x + dx, y + dy, z + dz) for dx, dy, dz in offsets)


def reflections(count: int) -> tuple[Vector, ...]:
    """Where `count` reflections lie that are no markers, m: on the floor, on a circle of 3 m."""
    angles = (2.0 * math.pi * i / count for i in range(count))
    return tuple((3.0 * math.cos(angle), 3.0 * math.sin(angle), 0.01) for angle in angles)
