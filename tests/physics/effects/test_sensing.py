"""What is measured: pose and gyro of the simulated lab and of learning rollouts."""

import math
from typing import Any

import numpy as np
import pytest

from mocap_bridge.rotation import angle_between
from onboard.rotation import rotate
from sim_backend.physics.effects.sensors import measured_rate, tracked_attitude, tracked_position
from sim_backend.physics.reset import approaching
from sim_backend.world import World
from tests.physics.effects.conftest import MakeParameters, with_effects

TILTED = (math.sin(0.2), 0.0, 0.0, math.cos(0.2))


def test_pose_and_rate_with_the_errors_of_the_vehicle(make: MakeParameters) -> None:
    p = make(
        {
            "pose_rotation": {"z": 0.1},
            "pose_offset": {"x": 0.01, "z": 0.03},
            "gyro_bias": {"y": 0.02},
        }
    )
    state = approaching(p, np.array([1.0, 2.0, 3.0]), np.zeros(3))
    state["quaternion"] = TILTED
    expected = np.array([1.0, 2.0, 3.0]) + rotate(TILTED, (0.01, 0.0, 0.03))
    np.testing.assert_allclose(tracked_position(state, p), expected, rtol=1e-14)
    seen = tracked_attitude(state, p)
    assert np.linalg.norm(seen) == pytest.approx(1.0, abs=1e-14)
    assert angle_between(TILTED, seen) == pytest.approx(0.1, rel=1e-12)
    # The turn is about the body's own axis, which it leaves where it is.
    np.testing.assert_allclose(rotate(seen, (0.0, 0.0, 1.0)), rotate(TILTED, (0.0, 0.0, 1.0)), atol=1e-14)
    np.testing.assert_allclose(measured_rate(state, p), [0.0, 0.02, 0.0])


def test_without_such_effects_the_pose_is_the_true_one(make: MakeParameters) -> None:
    p = make({"rotor_drag": {"coefficient": 1e-6}})
    state = approaching(p, np.array([1.0, 2.0, 3.0]), np.zeros(3))
    state["quaternion"] = TILTED
    assert tracked_position(state, p) == (1.0, 2.0, 3.0)
    assert tracked_attitude(state, p) == TILTED


def poses(world: World, count: int) -> list[Any]:
    """Positions that the room sees, every ms."""
    drone = world.drones[0]
    seen = []
    for _ in range(count):
        world.step()
        seen.append(drone.pose()[1])
        drone.state["velocity"] = [0.5, 0.0, 2.0]  # thrown up, so that every pose is another
    return seen


def test_the_room_sees_late_poses_and_the_firmware_a_biased_gyro() -> None:
    late = World(with_effects({"pose_delay": {"delay": 0.007}, "gyro_bias": {"x": 0.05}}))
    prompt = World(with_effects({}))
    assert poses(late, 40)[17:] == poses(prompt, 40)[10:-7]
    for world, bias in ((late, 0.05), (prompt, 0.0)):
        drone = world.drones[0]
        drone.place_on_start_mark()
        world.run(0.3)
        assert drone.firmware.sensors.gyro[0] == pytest.approx(bias, abs=0.01)
