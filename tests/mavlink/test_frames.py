"""ENU and FLU to NED and FRD, held against rotation matrices."""

import math

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from mocap_bridge.mavlink.frames import (
    euler_zyx,
    quaternion_from_euler_zyx,
    swap_attitude,
    swap_body,
    swap_world,
)

coordinate = st.floats(-50.0, 50.0)
vectors = st.tuples(coordinate, coordinate, coordinate)
quaternions = (
    st.tuples(*[st.floats(-1.0, 1.0)] * 4)
    .filter(lambda q: math.hypot(*q) > 0.1)
    .map(lambda q: tuple(v / math.hypot(*q) for v in q))
)


def test_axes() -> None:
    assert swap_world((1.0, 2.0, 3.0)) == (2.0, 1.0, -3.0)
    assert swap_body((1.0, 2.0, 3.0)) == (1.0, -2.0, -3.0)


def test_level_and_facing_east_is_a_yaw_of_ninety_degrees() -> None:
    roll, pitch, yaw = euler_zyx(swap_attitude((0.0, 0.0, 0.0, 1.0)))
    np.testing.assert_allclose((roll, pitch, yaw), (0.0, 0.0, math.pi / 2.0), atol=1e-15)


def test_nose_up_is_a_positive_pitch_and_left_turns_lessen_the_yaw() -> None:
    nose_up = (0.0, math.sin(-0.1), 0.0, math.cos(-0.1))  # about the body's left axis, downwards
    assert math.isclose(euler_zyx(swap_attitude(nose_up))[1], 0.2)
    left = (0.0, 0.0, math.sin(0.1), math.cos(0.1))
    assert math.isclose(euler_zyx(swap_attitude(left))[2], math.pi / 2.0 - 0.2)


@given(quaternions, vectors)
def test_a_body_vector_is_seen_the_same_in_either_world(q, v) -> None:
    seen = swap_world(tuple(Rotation.from_quat(q).apply(v)))
    theirs = Rotation.from_quat(swap_attitude(q)).apply(swap_body(v))
    np.testing.assert_allclose(theirs, seen, atol=1e-12)


@given(quaternions, vectors)
def test_twice_is_back(q, v) -> None:
    assert swap_world(swap_world(v)) == v
    assert swap_body(swap_body(v)) == v
    back = np.array(swap_attitude(swap_attitude(q)))
    np.testing.assert_allclose(abs(back @ np.array(q)), 1.0, atol=1e-12)


@given(quaternions)
def test_euler_angles_are_those_of_scipy(q) -> None:
    roll, pitch, yaw = euler_zyx(q)
    back = np.array(quaternion_from_euler_zyx(roll, pitch, yaw))
    np.testing.assert_allclose(abs(back @ np.array(q)), 1.0, atol=1e-9)
    theirs = Rotation.from_euler("ZYX", (yaw, pitch, roll)).as_quat()
    np.testing.assert_allclose(abs(theirs @ np.array(q)), 1.0, atol=1e-9)
