"""Poses out to a vehicle, read in ArduPilot's dialect of MAVLink."""

import math
import time

import numpy as np
import pytest
from pymavlink.dialects.v20 import ardupilotmega
from scipy.spatial.transform import Rotation

from mocap_bridge.health import PoseVerdict
from mocap_bridge.mavlink.address import MavlinkAddress
from mocap_bridge.mavlink.pose_sink import MavlinkPoseSink, PoseMessage
from mocap_bridge.pose import PoseSample
from tests.mavlink.ground import Listener

TURNED = tuple(float(v) for v in Rotation.from_euler("ZYX", (0.4, -0.3, 0.2)).as_quat())
AXES = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
EXPECTED = Rotation.from_matrix(AXES @ Rotation.from_quat(TURNED).as_matrix() @ np.diag([1.0, -1.0, -1.0]))


def sample(t: float = 12.5, frame: int = 1, x: float = 1.25) -> PoseSample:
    return PoseSample("cf1", frame, t, t + 0.004, (x, -2.5, 0.75), TURNED, False, 0.8, 0.004)


def degrees_from(expected: Rotation, quaternion: tuple[float, ...]) -> float:
    return math.degrees((expected.inv() * Rotation.from_quat(quaternion)).magnitude())


@pytest.mark.parametrize("kind", PoseMessage)
def test_a_vehicle_gets_the_pose_with_its_capture_time(kind: PoseMessage) -> None:
    names = {"odometry": "ODOMETRY", "mocap": "ATT_POS_MOCAP", "vision": "VISION_POSITION_ESTIMATE"}
    with (
        Listener() as vehicle,
        MavlinkPoseSink(MavlinkAddress("127.0.0.1", vehicle.port, None), kind) as sink,
    ):
        sink.on_sample(sample(), PoseVerdict.OK)
        got = vehicle.until(names[kind])
    np.testing.assert_allclose((got.x, got.y, got.z), (-2.5, 1.25, -0.75), atol=1e-6)
    if kind is PoseMessage.VISION:
        turned = Rotation.from_euler("ZYX", (got.yaw, got.pitch, got.roll))
        assert got.usec == 12_500_000
        assert degrees_from(EXPECTED, tuple(turned.as_quat())) < 1e-3
        assert math.isnan(got.covariance[0])
        return
    w, x, y, z = got.q
    assert got.time_usec == 12_500_000
    assert degrees_from(EXPECTED, (x, y, z, w)) < 1e-3
    if kind is PoseMessage.ODOMETRY:
        assert (got.frame_id, got.child_frame_id, got.estimator_type) == (20, 12, 6)
        assert got.quality == 80
        assert math.isnan(got.vx)
        assert math.isnan(got.pose_covariance[0])


def test_only_good_poses_go_out_and_a_lost_and_found_one_is_a_reset() -> None:
    with Listener() as vehicle, MavlinkPoseSink(MavlinkAddress("127.0.0.1", vehicle.port, None)) as sink:
        for verdict in PoseVerdict:
            if verdict is not PoseVerdict.OK:
                sink.on_sample(sample(x=9.0), verdict)
        assert sink.sent == 0
        for verdict in (
            PoseVerdict.OK,
            PoseVerdict.JUMPED,
            PoseVerdict.OK,
            PoseVerdict.STALE,
            PoseVerdict.LOST,
            PoseVerdict.OK,
        ):
            sink.on_sample(sample(), verdict)
        counters = []
        while len(counters) < 3:
            message = vehicle.until("ODOMETRY")
            assert message.y == 1.25
            counters.append(message.reset_counter)
        assert counters == [0, 0, 1]


def test_a_vehicle_learns_our_clock_and_may_not_command() -> None:
    with Listener() as vehicle, MavlinkPoseSink(MavlinkAddress("127.0.0.1", vehicle.port, None)) as sink:
        vehicle.until("HEARTBEAT", lambda m: m.type == ardupilotmega.MAV_TYPE_ONBOARD_CONTROLLER)
        vehicle.send(ardupilotmega.MAVLink_timesync_message(0, 77))
        answer = vehicle.until("TIMESYNC")
        assert answer.ts1 == 77
        assert abs(answer.tc1 - time.monotonic_ns()) < 60e9
        vehicle.send(ardupilotmega.MAVLink_command_long_message(1, 197, 400, 0, 1, 0, 0, 0, 0, 0, 0))
        assert vehicle.until("COMMAND_ACK").result == ardupilotmega.MAV_RESULT_DENIED
        assert sink.heard == {(255, 190)}
