"""What is drawn of a run, whatever draws it: the cage, the path of the approach, the vehicle with its legs.

World frame, m (ENU, z up); the vehicle in its body frame (FLU).
"""

import itertools
from dataclasses import dataclass, fields
from typing import Any

import numpy as np

from onboard.arrays import FloatArray
from onboard.room import RoomGeometry
from onboard.trajectory import ApproachPlan, sample_approach
from onboard.vehicle import Vehicle
from perchhw.label import landing_geometry

_PATH_STEP_S = 0.02
_RIM_POINTS = 33
_LARGEST = 1e3
"""m, s. No room and no approach is larger; a number that is does not come from one."""


@dataclass(frozen=True)
class CageShape:
    """The walls of a room as edges, its floor and ceiling as planes.

    Attributes:
        edges: strips of points (n, 3).
        floor, ceiling: corners of the planes, (4, 3); the ceiling with its tilt.
        triangles: of a plane, numbers of its corners.
    """

    edges: tuple[FloatArray, ...]
    floor: FloatArray
    ceiling: FloatArray
    triangles: tuple[tuple[int, int, int], ...] = ((0, 1, 3), (0, 3, 2))


@dataclass(frozen=True)
class VehicleShape:
    """A vehicle as strips of points (n, 3) and balls.

    Attributes:
        arms: from propeller to propeller.
        rims: of the propellers M1 to M4; the first and the last are in front.
        legs: from hip to foot; none where it has no legs.
        feet: (4, 3), or (0, 3).
        foot_radius: m.
    """

    arms: tuple[FloatArray, ...]
    rims: tuple[FloatArray, ...]
    legs: tuple[FloatArray, ...]
    feet: FloatArray
    foot_radius: float


def cage_shape(room: RoomGeometry) -> CageShape:
    """The shape of a room."""
    corners = list(itertools.product((room.x_min, room.x_max), (room.y_min, room.y_max)))
    floor = np.array([(x, y, room.floor_z) for x, y in corners])
    ceiling = np.array([(x, y, room.ceiling_at(x, y)) for x, y in corners])
    around = [0, 1, 3, 2, 0]
    walls = [np.stack([low, high]) for low, high in zip(floor, ceiling, strict=True)]
    return CageShape((*walls, floor[around], ceiling[around]), floor, ceiling)


def vehicle_shape(vehicle: Vehicle) -> VehicleShape:
    """The shape of a vehicle."""
    body, legs = vehicle.body, vehicle.legs
    sides = ((1, -1), (-1, -1), (-1, 1), (1, 1))
    motors = np.array(
        [(x * body.arm_x.value, y * body.arm_y.value, body.propeller_height_z.value) for x, y in sides]
    )
    angles = np.linspace(0.0, 2.0 * np.pi, _RIM_POINTS)
    circle = np.column_stack([np.cos(angles), np.sin(angles), np.zeros(_RIM_POINTS)])
    rims = tuple(body.propeller_radius.value * circle + motor for motor in motors)
    arms = (motors[[0, 2]], motors[[1, 3]])
    if legs is None:
        return VehicleShape(arms, rims, (), np.empty((0, 3)), 0.0)
    feet = landing_geometry(vehicle).feet
    outward = np.sign(feet[:, :2]) * (legs.hip_x.value, legs.hip_y.value)
    hips = np.column_stack([outward, np.full(4, legs.hip_z.value)])
    strips = tuple(np.stack([hip, foot]) for hip, foot in zip(hips, feet, strict=True))
    return VehicleShape(arms, rims, strips, feet, legs.foot_radius.value)


def approach_path(plan: ApproachPlan) -> FloatArray:
    """The reference from its start to the impact point, (n, 3)."""
    times = np.append(np.arange(0.0, plan.impact_time, _PATH_STEP_S), plan.impact_time)
    return np.array([sample_approach(plan, float(t))[0] for t in times])


def approach_of(config: dict[str, Any]) -> ApproachPlan | None:
    """The approach that a run's configuration holds; None where it holds none that can be read."""
    numbers = _numbers(config.get("approach"), ApproachPlan._fields)
    return None if numbers is None else ApproachPlan(**numbers)


def room_of(config: dict[str, Any]) -> RoomGeometry | None:
    """The room that a run's configuration holds; with the height of the ceiling alone, the usual walls."""
    numbers = _numbers(config.get("room"), tuple(field.name for field in fields(RoomGeometry)))
    if numbers is not None:
        return RoomGeometry(**numbers)
    ceiling_z = config.get("ceiling_z")
    return None if ceiling_z is None or not abs(ceiling_z) < _LARGEST else RoomGeometry(ceiling_z=ceiling_z)


def _numbers(given: Any, names: tuple[str, ...]) -> dict[str, float] | None:
    """The numbers `names` of an object that holds them and no others, all of a room's size."""
    if not isinstance(given, dict) or given.keys() != set(names):
        return None
    if not all(isinstance(value, int | float) and abs(value) < _LARGEST for value in given.values()):
        return None
    return {name: float(value) for name, value in given.items()}
