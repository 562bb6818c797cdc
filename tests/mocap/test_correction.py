"""The pose of the body from that of the tracked subject, and what is left alone."""

import math
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from mocap_bridge.bridge import PoseBridge
from mocap_bridge.correction import AS_TRACKED, PoseCorrection
from mocap_bridge.pose import PoseSample
from mocap_bridge.rotation import angle_between, multiply, rotate
from onboard.arrays import Quaternion, Vector
from tests.mocap.moving_room import MovingRoom
from tests.mocap.test_bridge import Drone

SAMPLE = PoseSample("cf1", 1, 10.0, 10.01, (1.0, 2.0, 3.0), (0.0, 0.0, 0.0, 1.0), False, None, None)
QUARTER_Z: Quaternion = (0.0, 0.0, math.sqrt(0.5), math.sqrt(0.5))
QUARTER_X: Quaternion = (math.sqrt(0.5), 0.0, 0.0, math.sqrt(0.5))

vectors = st.tuples(*[st.floats(-5.0, 5.0)] * 3).filter(any)
rotations = st.tuples(*[st.floats(-1.0, 1.0)] * 4).filter(lambda q: math.hypot(*q) > 0.1)


def unit(q: Quaternion) -> Quaternion:
    x, y, z, w = (part / math.hypot(*q) for part in q)
    return x, y, z, w


def test_without_a_correction_the_very_sample_goes_on() -> None:
    assert AS_TRACKED.apply(SAMPLE) is SAMPLE


def test_the_arm_turns_with_the_subject() -> None:
    """A body 0.1 m ahead of a subject that faces +y is 0.1 m along +y of it."""
    body = PoseCorrection(position=(0.1, 0.0, 0.0)).apply(replace(SAMPLE, quaternion=QUARTER_Z))
    assert body.position == pytest.approx((1.0, 2.1, 3.0))
    assert body.quaternion == pytest.approx(QUARTER_Z)


def test_the_rotation_is_in_the_axes_of_the_subject() -> None:
    """The subject faces +y; the body is rolled a quarter in it, its y axis points up, its x axis to +y."""
    body = PoseCorrection(quaternion=QUARTER_X).apply(replace(SAMPLE, quaternion=QUARTER_Z))
    assert body.position == SAMPLE.position
    assert body.quaternion is not None
    assert rotate(body.quaternion, (0.0, 1.0, 0.0)) == pytest.approx((0.0, 0.0, 1.0))
    assert rotate(body.quaternion, (1.0, 0.0, 0.0)) == pytest.approx((0.0, 1.0, 0.0))


@given(vectors, rotations, vectors, rotations)
def test_the_correction_back_gives_the_subject_again(
    p: Vector, q: Quaternion, arm: Vector, turn: Quaternion
) -> None:
    subject, turn = replace(SAMPLE, position=p, quaternion=unit(q)), unit(turn)
    body = PoseCorrection(position=arm, quaternion=turn).apply(subject)
    back = (-turn[0], -turn[1], -turn[2], turn[3])
    x, y, z = rotate(back, arm)
    again = PoseCorrection(position=(-x, -y, -z), quaternion=back).apply(body)
    assert again.position == pytest.approx(p, abs=1e-9)
    assert again.quaternion is not None
    assert angle_between(again.quaternion, unit(q)) < 1e-6
    assert body.quaternion == pytest.approx(multiply(unit(q), turn))


@pytest.mark.parametrize(
    "changes",
    [
        {"occluded": True},
        {"position": None, "quaternion": None, "occluded": True},
        {"position": (0.0, 0.0, 0.0)},
        {"position": (math.nan, 0.0, 0.0)},
        {"quaternion": (0.0, 0.0, 0.0, 0.0)},
    ],
)
def test_what_is_no_pose_is_not_made_to_look_like_one(changes: dict[str, object]) -> None:
    sample = replace(SAMPLE, **changes)
    assert PoseCorrection(position=(0.1, 0.0, 0.0), quaternion=QUARTER_X).apply(sample) is sample


def test_a_quaternion_of_the_wrong_length_keeps_it_for_the_health_to_refuse() -> None:
    body = PoseCorrection(position=(0.1, 0.0, 0.0), quaternion=QUARTER_X).apply(
        replace(SAMPLE, quaternion=(0.0, 0.0, 0.0, 1.01))
    )
    assert body.quaternion is not None
    assert math.hypot(*body.quaternion) == pytest.approx(1.01)
    assert body.position == pytest.approx((1.1, 2.0, 3.0))


def test_a_latency_ages_only_samples_that_do_not_tell_their_own() -> None:
    late = PoseCorrection(latency=0.02)
    assert late.apply(SAMPLE).capture_time == pytest.approx(SAMPLE.capture_time - 0.02)
    told = replace(SAMPLE, latency=0.004)
    assert late.apply(told) is told


def test_the_drone_gets_the_poses_of_its_body() -> None:
    """The subject circles at 1 m height; the body hangs 0.25 m below it."""
    drone = Drone()
    below = PoseCorrection(position=(0.0, 0.0, -0.25))
    with MovingRoom() as room, PoseBridge(room.uri, drone, correction=below) as bridge:
        assert bridge.wait_for(lambda status: status.sent >= 5, 120.0)
        status = bridge.status()
    assert all(z == pytest.approx(0.75, abs=1e-3) for _, (_, _, z), _ in drone.poses)
    assert status.last_good is not None
    assert status.last_good.position is not None
    assert status.last_good.position[2] == pytest.approx(0.75, abs=1e-3)
