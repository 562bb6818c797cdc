"""Poses as MAVLink sends them: ODOMETRY, ATT_POS_MOCAP or VISION_POSITION_ESTIMATE, of one system.

The subject of the URI is the number of the system that sends, or ``any``: then it is the first that is heard.
Of several kinds of message the first that is heard counts, so that a pose that comes in two is one sample.
Frame numbers are counted here, because MAVLink has none for poses: what is lost on the way is not seen.
"""

import math
from dataclasses import replace
from typing import Any

from mocap_bridge.errors import MocapUriError, PoseTimeout, UnknownSubject
from mocap_bridge.mavlink.address import read_key
from mocap_bridge.mavlink.endpoint import MESSAGES, MavlinkEndpoint, ReceivedMessage
from mocap_bridge.mavlink.frames import quaternion_from_euler_zyx, swap_attitude, swap_world
from mocap_bridge.mavlink.refusal import timesync_answer
from mocap_bridge.pose import PoseSample, SourceStatistics
from mocap_bridge.rotation import continuous
from mocap_bridge.sources.queued import QueuedStream
from mocap_bridge.timing import CaptureClock
from mocap_bridge.uri import MocapUri
from onboard.arrays import Quaternion, Vector
from onboard.timebase import Timebase

OPEN_TIMEOUT_S = 0.5
ANY_SYSTEM = "any"
SYSTEM, COMPONENT = 255, MESSAGES.MAV_COMP_ID_PERIPHERAL
_WORLD_FRAMES = (MESSAGES.MAV_FRAME_LOCAL_NED, MESSAGES.MAV_FRAME_LOCAL_FRD)
_NOMINAL_PERIOD_S = 0.01
"""Only tells the fit of capture times that the source has times at all."""

_FAILED = (0.0, 0.0, 0.0, 0.0)
"""No attitude: the sender says that its fit has failed."""

Pose = tuple[int, Vector, Quaternion]


def open_mavlink(uri: MocapUri, clock: Timebase) -> "MavlinkPoseStream":
    """Listen, and wait up to 0.5 s for a pose of the system.

    Raises:
        MocapUriError: the subject is no system, or the key cannot be used.
        SourceLost: the port cannot be taken.
        PoseTimeout: no MAVLink arrives.
        UnknownSubject: MAVLink arrives, but no poses of this system.
    """
    if uri.subject != ANY_SYSTEM and not (uri.subject.isdecimal() and 1 <= int(uri.subject) <= 255):
        raise MocapUriError(
            f"{uri}: the subject is the number of a MAVLink system, 1 to 255, or {ANY_SYSTEM!r}"
        )
    return MavlinkPoseStream(uri, clock).opened(OPEN_TIMEOUT_S)


class MavlinkPoseStream(QueuedStream):
    """An open listener (a ``PoseStream``)."""

    def __init__(self, uri: MocapUri, clock: Timebase) -> None:
        key = uri.option("key")
        self._endpoint = MavlinkEndpoint(
            SYSTEM,
            COMPONENT,
            key=None if key is None else read_key(key),
            listen=(uri.host, uri.port),
            ipv6=":" in uri.host,
        )
        super().__init__(uri, clock)
        self._capture = CaptureClock()
        self._chosen: tuple[int, str] | None = None

    def find_subject(self, deadline: float) -> None:
        """Receive until a pose came; errors as :func:`open_mavlink`."""
        while not self._samples and self._receive(deadline):
            pass
        if self._samples:
            return
        if not self._offered:
            refused = f" ({count} packets refused)" if (count := self.statistics().refused) else ""
            raise PoseTimeout(
                f"{self._uri}: no MAVLink arrives{refused}; is it sent to this port of this computer? "
                "Without an address only this computer is heard: name the one to listen on, or 0.0.0.0"
            )
        offered = tuple(self._offered)
        raise UnknownSubject(
            f"{self._uri}: no poses of system {self._uri.subject} in known axes; systems heard: "
            f"{', '.join(offered)}",
            offered,
        )

    def _receive(self, deadline: float) -> bool:
        """Take what has arrived, waiting for it until `deadline`; False when that has passed."""
        remaining = deadline - self._clock()
        if remaining <= 0.0:
            return False
        self._endpoint.wait(remaining)
        receipt_time = self._clock()
        for received in self._endpoint.receive():
            self._take(received, receipt_time)
        return True

    def _take(self, received: ReceivedMessage, receipt_time: float) -> None:
        self._offered[str(received.system)] = None
        answer = timesync_answer(received.message, receipt_time)
        if answer is not None:
            self._endpoint.send(answer, received.source)
        if self._uri.subject not in (ANY_SYSTEM, str(received.system)):
            return
        kind = received.message.get_type()
        reader = _READERS.get(kind)
        if reader is None or (self._chosen or (received.system, kind)) != (received.system, kind):
            return
        pose = reader(received.message)
        if pose is None:
            self._refused += 1
            return
        self._chosen = (received.system, kind)
        self._frames += 1
        self._samples.append(self._sample(pose, receipt_time))

    def _sample(self, pose: Pose, receipt_time: float) -> PoseSample:
        time_us, position, attitude = pose
        seen = all(math.isfinite(value) for value in (*position, *attitude)) and any(attitude)
        source_time = 1e-6 * time_us if time_us > 0 else None
        if seen:
            self._last = continuous(swap_attitude(attitude), self._last)
        return PoseSample(
            subject=self._uri.subject,
            frame=self._frames,
            capture_time=self._capture.capture_time(receipt_time, source_time, _NOMINAL_PERIOD_S, None),
            receipt_time=receipt_time,
            position=swap_world(position) if seen else None,
            quaternion=self._last if seen else None,
            occluded=not seen,
            source_time=source_time,
        )

    def statistics(self) -> SourceStatistics:
        """What is known about the stream so far."""
        return replace(super().statistics(), refused=self._refused + self._endpoint.refused)

    def close(self) -> None:
        """Close the socket."""
        self._endpoint.close()


def _odometry(message: Any) -> Pose | None:
    """Of worlds and bodies in other axes nothing is taken: a guess would be a crash."""
    if message.frame_id not in _WORLD_FRAMES or message.child_frame_id not in (
        MESSAGES.MAV_FRAME_BODY_FRD,
        message.frame_id,
    ):
        return None
    w, x, y, z = message.q if message.quality >= 0 else _FAILED
    return message.time_usec, (message.x, message.y, message.z), (x, y, z, w)


def _att_pos_mocap(message: Any) -> Pose | None:
    w, x, y, z = message.q
    return message.time_usec, (message.x, message.y, message.z), (x, y, z, w)


def _vision_position_estimate(message: Any) -> Pose | None:
    attitude = quaternion_from_euler_zyx(message.roll, message.pitch, message.yaw)
    return message.usec, (message.x, message.y, message.z), attitude


_READERS = {
    "ODOMETRY": _odometry,
    "ATT_POS_MOCAP": _att_pos_mocap,
    "VISION_POSITION_ESTIMATE": _vision_position_estimate,
}
