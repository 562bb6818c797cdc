"""Rigid-body kinematics and dynamics on scalars: quaternions, exponential map, Euler's equation."""

import math

from onboard.arrays import Quaternion, Vector
from sim_backend.physics.jit import inner, kernel


@kernel
def rotation_matrix(
    qx: float, qy: float, qz: float, qw: float
) -> tuple[float, float, float, float, float, float, float, float, float]:
    """The nine entries (row by row) of the matrix that turns body into world components; unit quaternion."""
    return (
        1.0 - 2.0 * (qy * qy + qz * qz),
        2.0 * (qx * qy - qz * qw),
        2.0 * (qx * qz + qy * qw),
        2.0 * (qx * qy + qz * qw),
        1.0 - 2.0 * (qx * qx + qz * qz),
        2.0 * (qy * qz - qx * qw),
        2.0 * (qx * qz - qy * qw),
        2.0 * (qy * qz + qx * qw),
        1.0 - 2.0 * (qx * qx + qy * qy),
    )


@kernel
def turn(q: Quaternion, wx: float, wy: float, wz: float, dt: float) -> Quaternion:
    """The quaternion after turning at the constant body rate (rad/s) for `dt` (s): q exp(w dt / 2).

    The series of sine and cosine is exact to the last bit for half angles below 0.03 rad (60 rad/s at 1 ms).
    """
    half = 0.5 * dt
    ax, ay, az = wx * half, wy * half, wz * half
    s2 = ax * ax + ay * ay + az * az
    if s2 < 1e-3:
        scale = 1.0 - s2 / 6.0 * (1.0 - s2 / 20.0 * (1.0 - s2 / 42.0))
        c = 1.0 - s2 / 2.0 * (1.0 - s2 / 12.0 * (1.0 - s2 / 30.0 * (1.0 - s2 / 56.0)))
    else:
        angle = math.sqrt(s2)
        scale = math.sin(angle) / angle
        c = math.cos(angle)
    ax, ay, az = ax * scale, ay * scale, az * scale
    qx, qy, qz, qw = q
    nx = qw * ax + qx * c + qy * az - qz * ay
    ny = qw * ay - qx * az + qy * c + qz * ax
    nz = qw * az + qx * ay - qy * ax + qz * c
    nw = qw * c - qx * ax - qy * ay - qz * az
    return nx, ny, nz, nw


@kernel
def unit(q: Quaternion) -> Quaternion:
    """A quaternion of nearly unit length brought back to it, to first order: it stays there to 1e-15."""
    scale = 1.5 - 0.5 * (q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3])
    return q[0] * scale, q[1] * scale, q[2] * scale, q[3] * scale


@kernel
def gyroscopic_torque(wx: float, wy: float, wz: float, ix: float, iy: float, iz: float) -> Vector:
    """-w x (I w) for a diagonal inertia (kg m2), N m in the body frame; its power w . T is zero."""
    return (iy - iz) * wy * wz, (iz - ix) * wz * wx, (ix - iy) * wx * wy


@inner
def turn_rate(
    wx: float, wy: float, wz: float, tx: float, ty: float, tz: float,
    ix: float, iy: float, iz: float, inv_x: float, inv_y: float, inv_z: float, dt: float,
) -> Vector:  # fmt: skip
    """Body rate (rad/s) after `dt` (s) of a constant torque (N m): Euler's equation by the midpoint rule."""
    half = 0.5 * dt
    gx, gy, gz = gyroscopic_torque(wx, wy, wz, ix, iy, iz)
    mx = wx + half * (tx + gx) * inv_x
    my = wy + half * (ty + gy) * inv_y
    mz = wz + half * (tz + gz) * inv_z
    gx, gy, gz = gyroscopic_torque(mx, my, mz, ix, iy, iz)
    return wx + dt * (tx + gx) * inv_x, wy + dt * (ty + gy) * inv_y, wz + dt * (tz + gz) * inv_z


@inner
def acceleration_beside(point: Vector, wx: float, wy: float, wz: float, turn_up: Vector) -> Vector:
    """What a point of the body accelerates by more than its centre of mass: a x r + w x (w x r), m/s2, body.

    Args:
        point: r, m from the centre of mass, body frame.
        wx, wy, wz: body rate w, rad/s.
        turn_up: angular acceleration a, rad/s2, body frame.
    """
    rx, ry, rz = point
    ax, ay, az = turn_up
    along = wx * rx + wy * ry + wz * rz
    square = wx * wx + wy * wy + wz * wz
    return (
        ay * rz - az * ry + wx * along - square * rx,
        az * rx - ax * rz + wy * along - square * ry,
        ax * ry - ay * rx + wz * along - square * rz,
    )
