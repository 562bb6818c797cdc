"""From setpoint to wrench: modes of the axes, positions that follow velocities, tilts, and what is kept."""

import math
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from onboard.arrays import Quaternion, Vector
from onboard.battery import FULL_RATIO
from onboard.controller import DEFAULT_GAINS, geometric_control
from onboard.follower import (
    CONTROL_PERIOD_MS,
    LEASH,
    MOST_AGE,
    FollowerSetpoint,
    Mode,
    follow,
    new_follower_memory,
    track,
)
from onboard.gravity import GRAVITY

ZERO: Vector = (0.0, 0.0, 0.0)
LEVEL: Quaternion = (0.0, 0.0, 0.0, 1.0)
THRUST_MAX = 0.147
DISABLED, ABSOLUTE, VELOCITY = int(Mode.DISABLED), int(Mode.ABSOLUTE), int(Mode.VELOCITY)
numbers = st.floats(-5.0, 5.0)
vectors = st.tuples(numbers, numbers, numbers)


def asked(**fields: Any) -> FollowerSetpoint:
    """A position setpoint with other fields."""
    absolute = FollowerSetpoint(
        modes=(ABSOLUTE, ABSOLUTE, ABSOLUTE),
        mode_roll=DISABLED,
        mode_pitch=DISABLED,
        mode_yaw=ABSOLUTE,
        mode_quaternion=DISABLED,
        velocity_body=False,
        position=ZERO,
        velocity=ZERO,
        acceleration=ZERO,
        roll=0.0,
        pitch=0.0,
        yaw=0.0,
        rates=ZERO,
        quaternion=LEVEL,
        thrust=0.0,
        age=0.0,
    )
    return absolute._replace(**fields)


def followed(
    setpoint: FollowerSetpoint, position: Vector = ZERO, attitude: Quaternion = LEVEL, steps: int = 1
) -> Any:
    """Memory after some steps in one place."""
    memory = new_follower_memory()
    for _ in range(steps):
        follow(memory, setpoint, position, attitude, DEFAULT_GAINS, THRUST_MAX)
    return memory


def quaternion_of(rotation: Rotation) -> Quaternion:
    x, y, z, w = rotation.as_quat().tolist()
    return x, y, z, w


@pytest.mark.further
@given(vectors, vectors, vectors, vectors, st.floats(-3.0, 3.0))
def test_a_position_setpoint_is_what_the_controller_tracks(
    at: Vector, moving: Vector, position: Vector, velocity: Vector, yaw: float
) -> None:
    setpoint = asked(position=position, velocity=velocity, acceleration=(0.1, -0.2, 0.3), yaw=yaw)
    memory = followed(setpoint, at)
    wrench = track(memory, at, moving, LEVEL, (0.1, 0.2, 0.3), DEFAULT_GAINS)
    limit = DEFAULT_GAINS.integral_limit
    x, y, z = (min(max(0.002 * (at[i] - position[i]), -limit), limit) for i in range(3))
    expected = geometric_control(
        at, moving, LEVEL, (0.1, 0.2, 0.3), (x, y, z), position, velocity, (0.1, -0.2, 0.3), yaw,
        DEFAULT_GAINS,
    )  # fmt: skip
    # To rounding: compiled within another function, or by itself, the same sum may round once less.
    assert wrench == pytest.approx(expected, rel=1e-12, abs=1e-18)


@given(vectors, vectors, vectors, st.floats(0.0, 3.0))
def test_between_two_setpoints_the_last_one_moves_on_for_a_while(
    position: Vector, velocity: Vector, acceleration: Vector, age: float
) -> None:
    memory = followed(
        asked(position=position, velocity=velocity, acceleration=acceleration, rates=(0.0, 0.0, 0.5), age=age)
    )
    t = min(age, MOST_AGE)
    for i in range(3):
        there = position[i] + velocity[i] * t + 0.5 * acceleration[i] * t * t
        assert memory.position[i] == pytest.approx(there, abs=1e-12)
        assert memory.velocity[i] == pytest.approx(velocity[i] + acceleration[i] * t, abs=1e-12)
    assert memory.yaw == pytest.approx(0.5 * t)


@given(vectors, st.integers(1, 300))
def test_a_position_that_follows_a_velocity_stays_on_its_leash(velocity: Vector, steps: int) -> None:
    setpoint = asked(modes=(VELOCITY, VELOCITY, VELOCITY), velocity=velocity)
    memory = followed(setpoint, (1.0, 2.0, 3.0), steps=steps)
    for i, here in enumerate((1.0, 2.0, 3.0)):
        ahead = min(max(0.002 * steps * velocity[i], -LEASH), LEASH)
        assert memory.position[i] - here == pytest.approx(ahead, abs=1e-9)


def test_a_drone_on_its_course_feels_no_jolt_where_a_setpoint_comes() -> None:
    velocity = (1.5, -0.8, 0.4)
    memory = new_follower_memory()
    for ms in range(0, 200, CONTROL_PERIOD_MS):
        given = 1e-3 * (ms - ms % 20)
        here = tuple(1e-3 * ms * v for v in velocity)
        setpoint = asked(
            position=tuple(given * v for v in velocity), velocity=velocity, age=1e-3 * ms - given
        )
        follow(memory, setpoint, here, LEVEL, DEFAULT_GAINS, THRUST_MAX)
        wrench = track(memory, here, velocity, LEVEL, ZERO, DEFAULT_GAINS)
        assert wrench == pytest.approx((DEFAULT_GAINS.mass * GRAVITY, 0.0, 0.0, 0.0), abs=1e-12)


def test_a_velocity_of_the_body_points_along_its_heading() -> None:
    ahead = asked(modes=(VELOCITY, VELOCITY, ABSOLUTE), velocity=(1.0, 0.0, 0.0), velocity_body=True)
    turned = quaternion_of(Rotation.from_euler("z", 90.0, degrees=True))
    assert followed(ahead, attitude=turned).velocity.tolist() == pytest.approx([0.0, 1.0, 0.0])


def test_a_disabled_axis_has_no_error() -> None:
    memory = followed(asked(modes=(DISABLED, DISABLED, ABSOLUTE), mode_roll=ABSOLUTE, mode_pitch=ABSOLUTE))
    wrench = track(memory, (3.0, -2.0, 0.0), (1.0, 1.0, 0.0), LEVEL, ZERO, DEFAULT_GAINS)
    assert wrench == pytest.approx((DEFAULT_GAINS.mass * GRAVITY, 0.0, 0.0, 0.0))


@pytest.mark.parametrize(("roll", "pitch", "yaw"), [(0.2, 0.0, 0.0), (0.0, 0.3, 1.0), (-0.2, 0.1, -2.0)])
def test_a_tilt_that_is_held_needs_no_moment(roll: float, pitch: float, yaw: float) -> None:
    attitude = quaternion_of(Rotation.from_euler("ZYX", [yaw, pitch, roll]))
    thrust = DEFAULT_GAINS.mass * GRAVITY / (4.0 * THRUST_MAX) * FULL_RATIO
    for mode_z in (DISABLED, ABSOLUTE):
        setpoint = asked(
            modes=(DISABLED, DISABLED, mode_z),
            mode_roll=ABSOLUTE,
            mode_pitch=ABSOLUTE,
            roll=roll,
            pitch=pitch,
            yaw=yaw,
            thrust=thrust if mode_z == DISABLED else 0.0,
        )
        wrench = track(followed(setpoint, attitude=attitude), ZERO, ZERO, attitude, ZERO, DEFAULT_GAINS)
        assert wrench[1:3] == pytest.approx((0.0, 0.0), abs=1e-12)
        least = DEFAULT_GAINS.mass * GRAVITY
        assert wrench[0] == pytest.approx(
            least if mode_z == DISABLED else least / math.cos(roll) / math.cos(pitch)
        )


def test_a_heading_follows_its_rate_from_where_the_drone_points() -> None:
    turning = asked(mode_yaw=VELOCITY, rates=(0.0, 0.0, 0.5))
    turned = quaternion_of(Rotation.from_euler("z", 0.3))
    memory = followed(turning, attitude=turned, steps=100)
    assert memory.yaw == pytest.approx(0.3 + 0.1)
    assert track(memory, ZERO, ZERO, turned, (0.0, 0.0, 0.5), DEFAULT_GAINS)[3] > 0.0


def test_a_quaternion_gives_the_heading() -> None:
    there = quaternion_of(Rotation.from_euler("ZYX", [1.2, 0.1, 0.0]))
    assert followed(asked(mode_quaternion=ABSOLUTE, quaternion=there)).yaw == pytest.approx(1.2)


def test_the_integral_is_bounded_and_rests_where_an_axis_is_disabled() -> None:
    memory = followed(asked(modes=(ABSOLUTE, DISABLED, ABSOLUTE)), (1.0, 1.0, -1.0), steps=1000)
    limit = DEFAULT_GAINS.integral_limit
    assert memory.integral.tolist() == pytest.approx([limit, 0.0, -limit])
