"""Vicon Tracker UDP object stream: the poses of one object, keyed by its name.

There is no handshake and no time in the stream: capture time is the receipt time. A frame may come in several
datagrams, so that an object is missing from a frame is known only when the next frame begins.
"""

import dataclasses
import socket
from collections import deque

from mocap_bridge.errors import PacketError, PoseTimeout, SourceLost, UnknownSubject
from mocap_bridge.pose import PoseSample
from mocap_bridge.rotation import continuous, quaternion_from_euler_xyz
from mocap_bridge.sources.queued import QueuedStream
from mocap_bridge.tracker_udp import NAME_BYTES, TrackerItem, decode_block
from mocap_bridge.uri import MocapUri
from onboard.taken_port import why_not_taken
from onboard.timebase import Timebase

OPEN_TIMEOUT_S = 0.5
ANY_ADDRESS = "0.0.0.0"
_RECEIVE_BYTES = 2048


def open_vicon_udp(uri: MocapUri, clock: Timebase) -> "ViconUdpStream":
    """Listen, and wait up to 0.5 s for a frame that has our object.

    Raises:
        SourceLost: the port cannot be taken.
        PoseTimeout: no object stream arrives.
        UnknownSubject: objects arrive, ours is not among them (a wrong name, or out of view).
    """
    listener = socket.socket(socket.AF_INET6 if ":" in uri.host else socket.AF_INET, socket.SOCK_DGRAM)
    try:
        listener.bind((uri.host, uri.port))
    except OSError as error:
        listener.close()
        raise SourceLost(
            f"cannot listen for Tracker's objects: {why_not_taken(error, 'UDP', uri.host, uri.port)}; does "
            "another perchhw listen to it? End that, or let Tracker send to another port"
        ) from error
    return ViconUdpStream(listener, uri, clock).opened(OPEN_TIMEOUT_S)


class ViconUdpStream(QueuedStream):
    """An open Tracker UDP listener (a ``PoseStream``)."""

    def __init__(self, listener: socket.socket, uri: MocapUri, clock: Timebase) -> None:
        super().__init__(uri, clock)
        self._socket = listener
        # Tracker cuts names; a longer one in the URI means the cut one on the wire.
        self._key = uri.subject.encode()[:NAME_BYTES].decode("utf-8", "replace")
        self._transport = clock.transport(f"tracker:{uri.port}")
        self._open_frame: int | None = None
        self._open_receipt = 0.0
        self._answered = False

    def find_subject(self, deadline: float) -> None:
        """Receive until our object appears; errors as :func:`open_vicon_udp`."""
        while self._key not in self._offered:
            if not self._receive(deadline):
                break
        self._samples = deque(sample for sample in self._samples if not sample.occluded)
        if self._key in self._offered:
            return
        if self._frames == 0:
            refused = f" ({self._refused} foreign datagrams)" if self._refused else ""
            raise PoseTimeout(
                f"no Tracker object stream on UDP port {self._uri.port} of {self._uri.host}{refused}; is it "
                f"enabled and sent to this computer?{self._elsewhere()}"
            )
        names = tuple(self._offered)
        listed = ", ".join(repr(name) for name in names) or "none"
        raise UnknownSubject(
            f"the stream on UDP port {self._uri.port} has no object {self._uri.subject!r}, "
            f"or it is out of view; seen: {listed}",
            names,
        )

    def _elsewhere(self) -> str:
        """What to write when the stream comes from another computer."""
        if not self._socket.getsockname()[0].startswith(("127.", "::1")):
            return ""
        return (
            " Only this computer is heard; from another one, name the address to listen on: "
            f"{dataclasses.replace(self._uri, host=ANY_ADDRESS)}"
        )

    def _receive(self, deadline: float) -> bool:
        """Take in one datagram; False at the deadline."""
        remaining = deadline - self._clock()
        if remaining <= 0.0:
            return False
        self._socket.settimeout(remaining)
        try:
            with self._transport.blocking():
                data = self._socket.recv(_RECEIVE_BYTES)
            self._transport.received(1)
        except TimeoutError:
            # Opening: a lab's deadline is not here because the machine was slow.
            return self._frames == 0 and self._clock() < deadline
        except OSError as error:
            raise SourceLost(f"UDP port {self._uri.port}: {error}") from error
        receipt_time = self._clock()
        try:
            block = decode_block(data)
        except PacketError:
            self._refused += 1
            return True
        self._begin_frame(block.frame, receipt_time)
        for item in block.items:
            self._offered[item.name] = None
            if item.name == self._key and not self._answered:
                self._answered = True
                self._samples.append(self._sample(block.frame, receipt_time, item))
        return True

    def _begin_frame(self, frame: int, receipt_time: float) -> None:
        """Close the frame before, when `frame` is another: our object was absent if nothing answered."""
        if frame == self._open_frame:
            return
        if self._open_frame is not None and not self._answered:
            self._samples.append(self._sample(self._open_frame, self._open_receipt, None))
        self._frames += 1
        self._open_frame = frame
        self._open_receipt = receipt_time
        self._answered = False

    def _sample(self, frame: int, receipt_time: float, item: TrackerItem | None) -> PoseSample:
        position, quaternion = None, None
        if item is not None and item.has_pose():
            x, y, z = item.position
            position = (x / 1000.0, y / 1000.0, z / 1000.0)
            quaternion = self._last = continuous(quaternion_from_euler_xyz(*item.angles), self._last)
        return PoseSample(
            subject=self._uri.subject,
            frame=frame,
            capture_time=receipt_time,
            receipt_time=receipt_time,
            position=position,
            quaternion=quaternion,
            occluded=position is None,
        )

    def close(self) -> None:
        """Close the socket."""
        self._socket.close()
        self._transport.close()
