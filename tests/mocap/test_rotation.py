import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from mocap_bridge.rotation import (
    angle_between,
    continuous,
    dot,
    euler_xyz_from_quaternion,
    is_rotation,
    matrix_from_quaternion,
    multiply,
    quaternion_from_euler_xyz,
    quaternion_from_matrix,
    slerp,
)

RNG = np.random.default_rng(3)
RANDOM = [tuple(q) for q in Rotation.random(200, random_state=3).as_quat()]
# Half turns and the like: where a branch of the conversion begins.
EDGES = [
    (0.0, 0.0, 0.0, 1.0), (1.0, 0.0, 0.0, 0.0), (0.0, 1.0, 0.0, 0.0), (0.0, 0.0, 1.0, 0.0),
    (math.sqrt(0.5), math.sqrt(0.5), 0.0, 0.0), (0.5, 0.5, 0.5, 0.5), (0.5, -0.5, 0.5, -0.5),
]  # fmt: skip


@pytest.mark.parametrize("q", RANDOM[:50] + EDGES)
def test_matrix_and_back_is_the_same_rotation(q):
    matrix = matrix_from_quaternion(q)
    np.testing.assert_allclose(np.reshape(matrix, (3, 3)), Rotation.from_quat(q).as_matrix(), atol=1e-14)
    assert is_rotation(matrix, 1e-12)
    assert angle_between(quaternion_from_matrix(matrix), q) < 1e-7


def test_products_agree_with_scipy():
    for a, b in zip(RANDOM[:50], RANDOM[50:100], strict=True):
        expected = Rotation.from_quat(a) * Rotation.from_quat(b)
        assert angle_between(multiply(a, b), tuple(expected.as_quat())) < 1e-7


def test_euler_angles_are_intrinsic_xyz():
    for angles in RNG.uniform(-3.1, 3.1, size=(50, 3)):
        q = quaternion_from_euler_xyz(*angles)
        assert angle_between(q, tuple(Rotation.from_euler("XYZ", angles).as_quat())) < 1e-7
        assert angle_between(q, quaternion_from_euler_xyz(*euler_xyz_from_quaternion(q))) < 1e-7


@pytest.mark.parametrize("pitch", [math.pi / 2, -math.pi / 2])
def test_euler_angles_at_the_singularity_still_describe_the_rotation(pitch):
    q = quaternion_from_euler_xyz(0.4, pitch, -0.9)
    assert angle_between(q, quaternion_from_euler_xyz(*euler_xyz_from_quaternion(q))) < 1e-6


def test_a_full_turn_about_z_never_changes_sign_when_made_continuous():
    previous = None
    for yaw in np.radians(np.arange(0.0, 720.0, 1.0)):
        matrix = matrix_from_quaternion((0.0, 0.0, math.sin(yaw / 2), math.cos(yaw / 2)))
        q = continuous(quaternion_from_matrix(matrix), previous)
        if previous is not None:
            assert dot(q, previous) > 0.99
        previous = q


def test_slerp_turns_at_constant_rate_along_the_short_way():
    a, b = (0.0, 0.0, 0.0, 1.0), (0.0, 0.0, -math.sin(0.6), -math.cos(0.6))
    for fraction in (0.0, 0.25, 0.5, 1.0):
        assert angle_between(a, slerp(a, b, fraction)) == pytest.approx(1.2 * fraction, abs=1e-7)


@pytest.mark.parametrize(
    "matrix",
    [
        (0.0,) * 9,
        (2.0, 0.0, 0.0, 0.0, 2.0, 0.0, 0.0, 0.0, 2.0),
        (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, -1.0),
        (1.0, 0.1, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0),
        (math.nan,) * 9,
    ],
)
def test_what_is_not_a_rotation_is_said_so(matrix):
    assert not is_rotation(matrix, 1e-3)
