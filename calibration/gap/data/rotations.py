"""Rotations of many samples at once: products, rotation vectors, the integral of a rate."""

import numpy as np
from scipy.spatial.transform import Rotation

from onboard.arrays import FloatArray


def integrate_rate(rate: FloatArray, dt: float) -> FloatArray:
    """Attitudes, shape (n, 4), of body rates (rad/s), shape (n, 3), sampled every `dt` s, from the identity.

    The rate is taken as linear between samples.
    """
    return accumulated(0.5 * (rate[1:] + rate[:-1]) * dt)


def accumulated(steps: FloatArray) -> FloatArray:
    """Attitudes (n + 1, 4) from the identity by one rotation vector about body axes (n, 3) after another.

    Products of all steps by a prefix scan (Hillis and Steele, 1986), which needs log2 n vectorised steps.
    """
    attitude = np.vstack([[0.0, 0.0, 0.0, 1.0], Rotation.from_rotvec(steps).as_quat()])
    shift = 1
    while shift < attitude.shape[0]:
        attitude[shift:] = products(attitude[:-shift], attitude[shift:])
        shift *= 2
    return np.asarray(attitude / np.linalg.norm(attitude, axis=1, keepdims=True))


def products(a: FloatArray, b: FloatArray) -> FloatArray:
    """Quaternion products a b, shape (n, 4) each: rotate by `b`, then by `a`."""
    u, s = a[:, :3], a[:, 3:]
    v, w = b[:, :3], b[:, 3:]
    vector = s * v + w * u + np.cross(u, v)
    return np.hstack([vector, s * w - np.sum(u * v, axis=1, keepdims=True)])


def conjugates(q: FloatArray) -> FloatArray:
    """Inverse rotations of unit quaternions, shape (n, 4)."""
    return q * np.array([-1.0, -1.0, -1.0, 1.0])


def turned(q: FloatArray, rotation: FloatArray) -> FloatArray:
    """q exp(r / 2): `q`, shape (n, 4), turned by rotation vectors about body axes, shape (3,) or (n, 3)."""
    turn = np.atleast_2d(Rotation.from_rotvec(rotation).as_quat())
    return products(q, np.broadcast_to(turn, q.shape))


def rotation_vectors(q: FloatArray) -> FloatArray:
    """Rotation vectors (rad), shape (n, 3), of unit quaternions, at most pi long."""
    return np.asarray(Rotation.from_quat(q).as_rotvec())


def matrices(q: FloatArray) -> FloatArray:
    """Rotation matrices, shape (n, 3, 3), body to world."""
    return np.asarray(Rotation.from_quat(q).as_matrix())


def cross_matrices(v: FloatArray) -> FloatArray:
    """Matrices [v]x, shape (n, 3, 3), with [v]x u = v x u."""
    zero = np.zeros(v.shape[0])
    x, y, z = v.T
    return np.stack([zero, -z, y, z, zero, -x, -y, x, zero], axis=1).reshape(-1, 3, 3)
