"""Vicon DataStream client (TCP): the poses of one subject, frame by frame.

Exchange: the server speaks first with the object ids it supports; we answer with those we use, ask it to
push, and ping: the echo says that it does. Every packet with a FrameInfo is a frame. A subject whose root
segment is not in GlobalSegments is occluded.
"""

import socket

from mocap_bridge.datastream.objects import (
    NO_FRAME,
    OBJECT_IDS,
    STREAM_CLOCK_HZ,
    Y_UP,
    ApplicationInfo,
    FrameInfo,
    GlobalSegments,
    LatencyInfo,
    ObjectEnums,
    ObjectQuality,
    Ping,
    RequestFrame,
    SegmentPose,
    StreamInfo,
    StreamObject,
    SubjectInfo,
)
from mocap_bridge.datastream.packet import PacketBuffer, decode_packet, encode_packet
from mocap_bridge.errors import (
    MocapError,
    PacketError,
    PoseTimeout,
    SourceLost,
    SourceUnusable,
    UnknownSubject,
)
from mocap_bridge.pose import PoseSample, SourceStatistics
from mocap_bridge.rotation import continuous, is_rotation, quaternion_from_matrix
from mocap_bridge.timing import CaptureClock, credible_latency
from mocap_bridge.uri import MocapUri
from onboard.arrays import Quaternion, Vector
from onboard.closing import Closing
from onboard.timebase import Timebase

OPEN_TIMEOUT_S = 0.5
PING_INTERVAL_S = 0.5
ROTATION_TOLERANCE = 1e-3
_RECEIVE_BYTES = 65536
_USED = (
    StreamInfo, SubjectInfo, FrameInfo, GlobalSegments, LatencyInfo, ApplicationInfo, ObjectQuality, Ping,
    ObjectEnums,
)  # fmt: skip
_USED_IDS = frozenset(OBJECT_IDS[kind] for kind in _USED)


def open_vicon(uri: MocapUri, clock: Timebase) -> "ViconStream":
    """Connect, negotiate, and wait for a frame that names the subjects; all within 0.5 s.

    Raises:
        SourceLost: refused, no greeting, or not a DataStream server.
        PoseTimeout: a server that greets and sends no frames.
        UnknownSubject: the server's subjects do not include ours.
        SourceUnusable: a Y-up world.
    """
    deadline = clock() + OPEN_TIMEOUT_S
    try:
        connection = socket.create_connection((uri.host, uri.port), timeout=OPEN_TIMEOUT_S)
    except OSError as error:
        raise SourceLost(
            f"no Vicon DataStream at {uri.host}:{uri.port} ({error}); is the server running and reachable?"
        ) from error
    stream = ViconStream(connection, uri, clock)
    try:
        stream.negotiate(deadline)
    except MocapError:
        stream.close()
        raise
    return stream


class ViconStream(Closing):
    """An open DataStream connection (a ``PoseStream``)."""

    def __init__(self, connection: socket.socket, uri: MocapUri, clock: Timebase) -> None:
        self._socket = connection
        self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self._uri = uri
        self._clock = clock
        self._transport = clock.transport(f"tcp:{connection.getsockname()[1]}")
        self._pushing = False
        self._buffer = PacketBuffer()
        self._receipt_time = clock()
        self._capture_clock = CaptureClock()
        self._subjects: dict[str, SubjectInfo] | None = None
        self._period: float | None = None
        self._quality: float | None = None
        self._last_quaternion: Quaternion | None = None
        self._pending: PoseSample | None = None
        self._frames = 0
        self._ignored_latencies = 0
        self._ping = 0
        self._ping_time = -PING_INTERVAL_S
        self._round_trip: float | None = None

    def negotiate(self, deadline: float) -> None:
        """The exchange up to the first frame with subjects; errors as :func:`open_vicon`."""
        greeting = self._next_packet(deadline)
        if greeting is None:
            raise SourceLost(
                f"{self._name()} accepts connections and does not greet: not a Vicon DataStream server?"
            )
        offered = next((item for item in greeting if isinstance(item, ObjectEnums)), None)
        if offered is None:
            raise SourceLost(f"{self._name()} greets without its object list: not a Vicon DataStream server?")
        missing = {OBJECT_IDS[kind] for kind in (SubjectInfo, FrameInfo, GlobalSegments)} - set(offered.ids)
        if missing:
            raise SourceUnusable(
                f"{self._name()} does not offer object ids {sorted(missing)}: no poses to be had"
            )
        wanted = tuple(sorted(_USED_IDS & set(offered.ids)))
        self._send([ObjectEnums(wanted)])
        self._send([RequestFrame(1)])
        self._send_ping()
        while self._subjects is None or self._pending is None:
            packet = self._next_packet(deadline)
            if packet is None:
                raise PoseTimeout(
                    f"{self._name()} greets and sends no frames with subjects; is it capturing live?"
                )
            self._pending = self._take(packet) or self._pending
        if self._uri.subject not in self._subjects:
            names = tuple(self._subjects)
            listed = ", ".join(repr(name) for name in names) or "none"
            raise UnknownSubject(
                f"{self._name()} has no subject {self._uri.subject!r}; it offers: {listed}", names
            )

    def read(self, timeout_s: float) -> PoseSample:
        """The next frame; see :meth:`PoseStream.read`."""
        if self._pending is not None:
            sample, self._pending = self._pending, None
            return sample
        deadline = self._clock() + timeout_s
        while (packet := self._next_packet(deadline)) is not None:
            sample_or_none = self._take(packet)
            if sample_or_none is not None:
                return sample_or_none
        raise PoseTimeout(f"{self._name()}: no frame within {timeout_s:.3g} s")

    def _next_packet(self, deadline: float) -> list[StreamObject] | None:
        """The next packet decoded, or None at the deadline."""
        try:
            while (packet := self._buffer.next_packet()) is None:
                remaining = deadline - self._clock()
                if remaining <= 0.0:
                    return None
                self._socket.settimeout(remaining)
                try:
                    data = self._receive()
                except TimeoutError:
                    if self._pending is None and self._frames == 0:
                        continue  # opening: a lab's deadline is not here because the machine was slow
                    raise
                self._receipt_time = self._clock()
                if not data:
                    raise SourceLost(f"{self._name()} closed the connection")
                self._buffer.feed(data)
            self._transport.received(1)
            return decode_packet(packet, _USED_IDS)
        except TimeoutError:
            return None
        except OSError as error:
            raise SourceLost(f"{self._name()}: connection lost ({error})") from error
        except PacketError as error:
            raise SourceLost(f"{self._name()}: {error}") from error

    def _receive(self) -> bytes:
        """What comes next. Until the server pushes, a lab's time waits with us: no frame is on its way."""
        if not self._pushing:
            return self._socket.recv(_RECEIVE_BYTES)
        with self._transport.blocking():
            return self._socket.recv(_RECEIVE_BYTES)

    def _take(self, packet: list[StreamObject]) -> PoseSample | None:
        """Use what a packet holds; a sample when it was a frame with data."""
        frame_id: int | None = None
        latency: float | None = None
        segments: dict[int, tuple[SegmentPose, ...]] = {}
        qualities: dict[int, float] = {}
        named: dict[str, SubjectInfo] = {}
        for item in packet:
            match item:
                case FrameInfo(number):
                    frame_id = number
                case GlobalSegments(subject, poses):
                    segments[subject] = poses
                case LatencyInfo(stages):
                    latency = sum(seconds for _, seconds in stages)
                case ObjectQuality(subject, quality):
                    qualities[subject] = quality
                case SubjectInfo(_, name):
                    named[name] = item
                case StreamInfo(ticks):
                    self._period = ticks / STREAM_CLOCK_HZ if ticks > 0 else None
                case ApplicationInfo(axis) if axis == Y_UP:
                    raise SourceUnusable(f"{self._name()} streams a Y-up world; set it to Z-up")
                case Ping(number) if number == self._ping:
                    self._round_trip = self._receipt_time - self._ping_time
                    self._pushing = True
        if named:
            self._subjects = named
        if frame_id is None or frame_id == NO_FRAME:
            return None
        self._frames += 1
        self._ping_when_due()
        subject_info = (self._subjects or {}).get(self._uri.subject)
        position, quaternion, quality_or_none = None, None, None
        if subject_info is not None:
            position, quaternion = self._pose(subject_info, segments.get(subject_info.subject, ()))
            quality_or_none = qualities.get(subject_info.subject)
        return self._sample(frame_id, latency, position, quaternion, quality_or_none)

    def _pose(
        self, subject: SubjectInfo, segments: tuple[SegmentPose, ...]
    ) -> tuple[Vector, Quaternion] | tuple[None, None]:
        """Pose of the subject's root segment, or nothing when it is absent, zero, or not a rotation."""
        roots = {segment.segment for segment in subject.segments if segment.parent == 0}
        pose = next((pose for pose in segments if pose.segment in roots), None)
        # A length beyond a kilometre is damage; the comparison is also false for NaN.
        if pose is None or not all(abs(value) < 1e6 for value in pose.position) or not any(pose.position):
            return None, None
        if not is_rotation(pose.rotation, ROTATION_TOLERANCE):
            return None, None
        self._last_quaternion = continuous(quaternion_from_matrix(pose.rotation), self._last_quaternion)
        x, y, z = pose.position
        return (x / 1000.0, y / 1000.0, z / 1000.0), self._last_quaternion

    def _sample(
        self,
        frame_id: int,
        reported_latency: float | None,
        position: Vector | None,
        quaternion: Quaternion | None,
        quality: float | None,
    ) -> PoseSample:
        latency = credible_latency(reported_latency)
        if reported_latency is not None and latency is None:
            self._ignored_latencies += 1
        source_time = frame_id * self._period if self._period is not None else None
        one_way = (self._round_trip or 0.0) / 2.0
        capture_time = self._capture_clock.capture_time(
            self._receipt_time, source_time, self._period, latency, one_way
        )
        return PoseSample(
            subject=self._uri.subject,
            frame=frame_id + 1,  # as the vendor's SDK counts
            capture_time=capture_time,
            receipt_time=self._receipt_time,
            position=position,
            quaternion=quaternion,
            occluded=position is None,
            quality=quality,
            latency=latency,
            source_time=source_time,
        )

    def _ping_when_due(self) -> None:
        if self._receipt_time - self._ping_time >= PING_INTERVAL_S:
            self._send_ping()

    def _send_ping(self) -> None:
        self._ping += 1
        self._ping_time = self._clock()
        self._send([Ping(self._ping)])

    def _send(self, objects: list[StreamObject]) -> None:
        try:
            self._socket.sendall(encode_packet(objects))
        except OSError as error:
            raise SourceLost(f"{self._name()}: connection lost ({error})") from error

    def _name(self) -> str:
        return f"vicon://{self._uri.host}:{self._uri.port}"

    def statistics(self) -> SourceStatistics:
        """What is known about the connection so far."""
        return SourceStatistics(
            frames=self._frames,
            subjects=tuple(self._subjects or ()),
            period=self._period,
            round_trip=self._round_trip,
            ignored_latencies=self._ignored_latencies,
        )

    def close(self) -> None:
        """Close the socket."""
        self._socket.close()
        self._transport.close()
