"""Quaternion helpers against scipy's rotations, and their invariants."""

import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from mocap_bridge.rotation import angle_between
from onboard import rotation

RNG = np.random.default_rng(1)
ROTATIONS = Rotation.random(50, random_state=2)


@pytest.mark.parametrize("index", range(10))
def test_rotate_and_matrix_agree_with_scipy(index: int) -> None:
    turn = ROTATIONS[index]
    q, v = turn.as_quat(), RNG.normal(size=3)
    np.testing.assert_allclose(rotation.rotate(q, v), turn.apply(v), atol=1e-14)
    matrix = rotation.to_matrix(q)
    np.testing.assert_allclose(matrix, turn.as_matrix(), atol=1e-14)
    axes = [rotation.body_x(q), rotation.body_y(q), rotation.body_z(q)]
    np.testing.assert_allclose(np.column_stack(axes), matrix, atol=1e-15)


def test_product_turns_by_the_right_factor_first() -> None:
    a, b = ROTATIONS[0], ROTATIONS[1]
    product = Rotation.from_quat(rotation.multiply(a.as_quat(), b.as_quat()))
    np.testing.assert_allclose(product.as_matrix(), (a * b).as_matrix(), atol=1e-14)


def test_matrices_of_many_quaternions_of_any_length() -> None:
    lengths = RNG.uniform(0.5, 2.0, (len(ROTATIONS), 1))
    matrices = rotation.to_matrices(lengths * ROTATIONS.as_quat())
    np.testing.assert_allclose(matrices, ROTATIONS.as_matrix(), atol=1e-14)


@pytest.mark.parametrize("size", [0.0, 1e-12, 1e-5, 0.99e-4, 1.01e-4, 0.1, 3.0])
def test_exponential_map(size: float) -> None:
    vector = size * np.array([0.6, -0.64, 0.48])
    q = rotation.from_rotation_vector(vector)
    np.testing.assert_allclose(q, Rotation.from_rotvec(vector).as_quat(), atol=1e-15)


def test_integration_of_a_constant_rate_is_exact_and_stays_on_the_sphere() -> None:
    omega, q = (3.0, -25.0, 1.0), tuple(ROTATIONS[3].as_quat())
    for _ in range(1000):
        q = rotation.integrate(q, omega, 1e-3)
    assert abs(math.hypot(*q) - 1.0) < 1e-12
    exact = (ROTATIONS[3] * Rotation.from_rotvec(np.array(omega))).as_quat()
    assert angle_between(q, tuple(exact)) < 1e-7


def test_euler_angles_are_z_y_x_with_nose_down_positive() -> None:
    turn = Rotation.from_euler("ZYX", [0.5, 0.3, -0.2])
    np.testing.assert_allclose(rotation.euler_angles(turn.as_quat()), [-0.2, 0.3, 0.5], atol=1e-12)
    nose_down = rotation.from_rotation_vector((0.0, 0.3, 0.0))
    assert rotation.body_x(nose_down)[2] < 0.0
    assert rotation.euler_angles(nose_down)[1] == pytest.approx(0.3)
    np.testing.assert_allclose(rotation.euler_angles(rotation.from_yaw(2.0)), [0.0, 0.0, 2.0], atol=1e-12)


def test_a_quaternion_without_direction_is_not_made_up() -> None:
    assert all(math.isnan(part) for part in rotation.normalise((0.0, 0.0, 0.0, 0.0)))
    assert all(math.isnan(part) for part in rotation.normalise((math.nan, 0.0, 0.0, 1.0)))
    np.testing.assert_allclose(rotation.normalise((0.0, 0.0, 3.0, 4.0)), (0.0, 0.0, 0.6, 0.8))
