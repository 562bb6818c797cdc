"""The forces of free flight, in one place.

The base model is rotors and linear drag. Effects that a vehicle file declares are in
:mod:`sim_backend.physics.effects`, what it knows without a name in :mod:`sim_backend.physics.unnamed`, behind
one test, so that a vehicle without them does not pay for them.
Gravity and the gyroscopic torque of the body belong to the integrator, contact to the step.
"""

from typing import Any

from sim_backend.physics.air import linear_drag
from sim_backend.physics.frames import Rotation, Wrench
from sim_backend.physics.jit import inner, kernel
from sim_backend.physics.motors import rotor_wrench
from sim_backend.physics.unnamed import wrench_with_unnamed
from sim_backend.physics.wrench_with_effects import wrench_with_effects


@inner
def add(a: Wrench, b: Wrench) -> Wrench:
    """Sum of two wrenches."""
    return a[0] + b[0], a[1] + b[1], a[2] + b[2], a[3] + b[3], a[4] + b[4], a[5] + b[5]


@kernel
def free_flight_wrench(state: Any, p: Any, rot: Rotation, vx: float, vy: float, vz: float) -> Wrench:
    """Force (N) and torque (N m) on the body in the body frame.

    Args:
        state, p: records.
        rot: rotation matrix body to world, row by row.
        vx, vy, vz: velocity in the body frame, m/s.
    """
    if p.forces_on:
        if p.unnamed_count > 0:
            return wrench_with_unnamed(state, p, rot, vx, vy, vz)
        return wrench_with_effects(state, p, rot, vx, vy, vz)
    return add(rotor_wrench(state, p), linear_drag(state, p, vx, vy, vz))
