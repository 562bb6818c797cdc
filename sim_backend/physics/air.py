"""Air on the body: linear drag."""

from typing import Any

from sim_backend.physics.frames import Wrench
from sim_backend.physics.jit import inner


@inner
def linear_drag(state: Any, p: Any, vx: float, vy: float, vz: float) -> Wrench:
    """Force -d v along each body axis (N) for the velocity in the body frame (m/s); no torque."""
    return -p.drag[0] * vx, -p.drag[1] * vy, -p.drag[2] * vz, 0.0, 0.0, 0.0
