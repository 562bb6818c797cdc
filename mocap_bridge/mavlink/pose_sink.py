"""Poses to a vehicle with PX4 or ArduPilot, as the message that it uses.

PX4's estimator takes ODOMETRY and VISION_POSITION_ESTIMATE and leaves ATT_POS_MOCAP to others; ArduPilot
takes each (https://docs.px4.io/main/en/ros/external_position_estimation,
https://ardupilot.org/dev/docs/mavlink-nongps-position-estimation.html). One kind is sent, because a vehicle
that takes two would believe every pose twice. Times are of capture, by our clock; a vehicle learns its offset
from its own by TIMESYNC, which is answered.
"""

import math
from enum import StrEnum
from typing import Any

from mocap_bridge.errors import MocapError
from mocap_bridge.health import PoseVerdict
from mocap_bridge.mavlink.address import MavlinkAddress
from mocap_bridge.mavlink.endpoint import MESSAGES
from mocap_bridge.mavlink.frames import euler_zyx, swap_attitude, swap_world
from mocap_bridge.mavlink.sender import MavlinkSender
from mocap_bridge.pose import PoseSample
from onboard.clock import Clock, monotonic

COMPONENT = MESSAGES.MAV_COMP_ID_VISUAL_INERTIAL_ODOMETRY
HEARTBEAT_PERIOD_S = 1.0
_NAN = math.nan
_UNKNOWN_COVARIANCE = [_NAN] + [0.0] * 20
"""NaN first says that it is not known; zeros would claim perfection."""
_POLL_S = 0.05


class PoseMessage(StrEnum):
    """The messages that carry a pose."""

    ODOMETRY = "odometry"
    VISION = "vision"  # VISION_POSITION_ESTIMATE
    MOCAP = "mocap"  # ATT_POS_MOCAP


class MavlinkPoseSink(MavlinkSender):
    """Takes samples as ``on_sample`` of a :class:`mocap_bridge.bridge.PoseBridge`; a context manager.

    Only samples with the verdict ``ok`` are sent, at once and without waiting for anybody. A lost and found
    pose raises the counter of resets.

    Args:
        address: of the vehicle.
        kind: the message that it is sent.
        clock: that of the samples.

    Attributes:
        sent: poses sent.
        heard: systems that have sent anything, as (system, component).

    Raises:
        MocapUriError: nobody knows the host.
    """

    def __init__(
        self, address: MavlinkAddress, kind: PoseMessage = PoseMessage.ODOMETRY, clock: Clock = monotonic
    ) -> None:
        super().__init__(address, COMPONENT, clock, "mavlink-vehicle", ends_within=1.0)
        self._kind = kind
        self._resets = 0
        self._locked = False
        self.sent = 0
        self.heard: set[tuple[int, int]] = set()

    def on_sample(self, sample: PoseSample, verdict: PoseVerdict) -> None:
        """Send the sample if it is good; from the bridge's thread."""
        if verdict in (PoseVerdict.STALE, PoseVerdict.LOST):
            self._resets += self._locked
            self._locked = False
        if verdict is not PoseVerdict.OK or sample.position is None or sample.quaternion is None:
            return
        self._locked = True
        self._endpoint.send(pose_message(self._kind, sample, self._resets % 256), self._to)
        self.sent += 1

    def _run(self) -> None:
        next_heartbeat = -math.inf
        while not self._stopping.is_set():
            if self._clock() >= next_heartbeat:
                next_heartbeat = self._clock() + HEARTBEAT_PERIOD_S
                self._endpoint.send(_heartbeat(), self._to)
            self._endpoint.wait(_POLL_S)
            for received in self._endpoint.receive():
                self.heard.add((received.system, received.component))
                if (text := self._answer(received)) is not None:
                    self._endpoint.send(_said(text), received.source)


def pose_message(kind: PoseMessage, sample: PoseSample, resets: int) -> Any:
    """A sample that has a pose as a message. Velocity and covariance are not known, and say so.

    Args:
        kind: of the message.
        sample: with position and quaternion.
        resets: how often the poses were lost and found, 0..255.
    """
    if sample.position is None or sample.quaternion is None:
        raise MocapError(f"frame {sample.frame} of {sample.subject!r} has no pose that could be sent")
    time_us = max(0, round(1e6 * sample.capture_time))
    place, attitude = swap_world(sample.position), swap_attitude(sample.quaternion)
    x, y, z, w = attitude
    if kind is PoseMessage.MOCAP:
        return MESSAGES.MAVLink_att_pos_mocap_message(time_us, [w, x, y, z], *place, _UNKNOWN_COVARIANCE)
    if kind is PoseMessage.VISION:
        return MESSAGES.MAVLink_vision_position_estimate_message(
            time_us, *place, *euler_zyx(attitude), _UNKNOWN_COVARIANCE, resets
        )
    return MESSAGES.MAVLink_odometry_message(
        time_us,
        MESSAGES.MAV_FRAME_LOCAL_FRD,
        MESSAGES.MAV_FRAME_BODY_FRD,
        *place,
        [w, x, y, z],
        *[_NAN] * 6,
        _UNKNOWN_COVARIANCE,
        _UNKNOWN_COVARIANCE,
        resets,
        MESSAGES.MAV_ESTIMATOR_TYPE_MOCAP,
        _quality(sample.quality),
    )


def _quality(quality: float | None) -> int:
    """Per cent; 0 stands for unknown."""
    return 0 if quality is None else max(1, round(100.0 * min(quality, 1.0)))


def _heartbeat() -> Any:
    return MESSAGES.MAVLink_heartbeat_message(
        MESSAGES.MAV_TYPE_ONBOARD_CONTROLLER,
        MESSAGES.MAV_AUTOPILOT_INVALID,
        0,
        0,
        MESSAGES.MAV_STATE_ACTIVE,
        3,
    )


def _said(text: str) -> Any:
    return MESSAGES.MAVLink_statustext_message(MESSAGES.MAV_SEVERITY_WARNING, text.encode()[:50])
