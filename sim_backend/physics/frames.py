"""Components of a vector in the world and in the body frame, and cross products, on scalars."""

from onboard.arrays import Vector
from sim_backend.physics.jit import inner, kernel

Rotation = tuple[float, float, float, float, float, float, float, float, float]
"""Rotation matrix, row by row, that turns body into world components."""

Wrench = tuple[float, float, float, float, float, float]
"""Force and torque, body frame."""


@kernel
def to_body(rot: Rotation, x: float, y: float, z: float) -> Vector:
    """World to body components."""
    return (
        rot[0] * x + rot[3] * y + rot[6] * z,
        rot[1] * x + rot[4] * y + rot[7] * z,
        rot[2] * x + rot[5] * y + rot[8] * z,
    )


@kernel
def to_world(rot: Rotation, x: float, y: float, z: float) -> Vector:
    """Body to world components."""
    return (
        rot[0] * x + rot[1] * y + rot[2] * z,
        rot[3] * x + rot[4] * y + rot[5] * z,
        rot[6] * x + rot[7] * y + rot[8] * z,
    )


@inner
def cross(a: Vector, b: Vector) -> Vector:
    """a x b."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]
