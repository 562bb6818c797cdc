"""What a vehicle file knows without a name: a force or torque over one quantity of the state.

One equation for all who fly a vehicle: simulation, rollouts of the learning, predictions of the gap finder.
"""

import math
from typing import Any

import numpy as np

from onboard.vehicle import Vehicle
from onboard.vehicle.unnamed import CHANNELS, MOST_CURVES, MOST_KNOTS, REGRESSORS
from sim_backend.physics.frames import Rotation, Wrench
from sim_backend.physics.jit import inner, outlined
from sim_backend.physics.wrench_with_effects import wrench_with_effects

FIELDS = (
    ("unnamed_count", "i8"),
    ("unnamed_channel", "i8", (MOST_CURVES,)),  # index in CHANNELS
    ("unnamed_regressor", "i8", (MOST_CURVES,)),  # index in REGRESSORS
    ("unnamed_knots", "f8", (MOST_CURVES, MOST_KNOTS)),  # SI; infinite behind the last
    ("unnamed_values", "f8", (MOST_CURVES, MOST_KNOTS)),  # N, N m
)
"""What curves need in the record of parameters."""

_CEILING, _VELOCITY, _AIRSPEED, _CLIMB, _RATE = (
    np.int64(tuple(REGRESSORS).index(name))
    for name in ("ceiling_distance", "velocity_x", "airspeed", "vertical_speed", "rate_x")
)
_WORLD, _TORQUE = (np.int64(tuple(CHANNELS).index(name)) for name in ("world_force_x", "torque_x"))


def apply_unnamed(p: Any, vehicle: Vehicle) -> None:
    """Write the curves of a vehicle into its record of parameters."""
    p["unnamed_knots"] = np.inf
    for index, curve in enumerate(vehicle.unnamed):
        count = len(curve.knots)
        p["unnamed_channel"][index] = tuple(CHANNELS).index(curve.channel)
        p["unnamed_regressor"][index] = tuple(REGRESSORS).index(curve.regressor)
        p["unnamed_knots"][index, :count] = curve.knots
        p["unnamed_values"][index, :count] = curve.values
        p["unnamed_values"][index, count:] = curve.values[-1]
    if vehicle.unnamed:
        p["unnamed_count"] = len(vehicle.unnamed)
        p["forces_on"] = 1


@inner
def quantity(state: Any, p: Any, which: int, vx: float, vy: float, vz: float) -> float:
    """The regressor with this index, SI; `vx`, `vy`, `vz`: velocity in the body frame, m/s."""
    if which < _CEILING:
        return state.position[which]
    if which >= _RATE:
        return state.omega[which - _RATE]
    if which == _CEILING:
        return p.ceiling_z - state.position[2]
    if which == _AIRSPEED:
        return math.sqrt(vx * vx + vy * vy + vz * vz)
    if which == _CLIMB:
        return state.velocity[2]
    if which == _VELOCITY:
        return vx
    return vy if which == _VELOCITY + 1 else vz


@inner
def curve_at(knots: Any, values: Any, x: float) -> float:
    """Value of a curve at `x`."""
    if not x > knots[0]:
        return values[0]
    for k in range(1, MOST_KNOTS):
        if x < knots[k]:
            share = (x - knots[k - 1]) / (knots[k] - knots[k - 1])
            return values[k - 1] + share * (values[k] - values[k - 1])
    return values[MOST_KNOTS - 1]


@outlined
def wrench_with_unnamed(state: Any, p: Any, rot: Rotation, vx: float, vy: float, vz: float) -> Wrench:
    """Force (N) and torque (N m) on the body in the body frame, as ``forces.free_flight_wrench``."""
    fx, fy, fz, tx, ty, tz = wrench_with_effects(state, p, rot, vx, vy, vz)
    for index in range(p.unnamed_count):
        x = quantity(state, p, p.unnamed_regressor[index], vx, vy, vz)
        value = curve_at(p.unnamed_knots[index], p.unnamed_values[index], x)
        channel = p.unnamed_channel[index]
        axis = channel % 3
        if channel >= _TORQUE:
            tx += value if axis == 0 else 0.0
            ty += value if axis == 1 else 0.0
            tz += value if axis == 2 else 0.0
        elif channel >= _WORLD:
            fx += value * rot[3 * axis]
            fy += value * rot[3 * axis + 1]
            fz += value * rot[3 * axis + 2]
        else:
            fx += value if axis == 0 else 0.0
            fy += value if axis == 1 else 0.0
            fz += value if axis == 2 else 0.0
    return fx, fy, fz, tx, ty, tz
