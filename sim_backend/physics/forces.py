"""The terms of the free-flight model, in one place.

A term is a function ``(state, parameters, body-frame velocity) -> wrench`` in a module of its own; it joins
the model by one line in :func:`free_flight_wrench`. A vehicle without the effect has zero for its parameter.
Gravity and the gyroscopic torque belong to the integrator, contact to the step.
"""

from typing import Any

from onboard.jit import kernel
from sim_backend.physics.air import linear_drag
from sim_backend.physics.frames import Rotation
from sim_backend.physics.motors import Wrench, rotor_wrench


@kernel
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
    wrench = rotor_wrench(state, p)
    wrench = add(wrench, linear_drag(state, p, vx, vy, vz))
    return wrench  # noqa: RET504  (one line a term)
