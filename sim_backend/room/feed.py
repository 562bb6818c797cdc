"""True poses from the world's process to the room's: loopback UDP datagrams of one or more world updates.

An update, little-endian, packed: ``u32 magic "PFD1" | u16 bodies | u16 flags | f64 world time (s)``, then per
body ``char[24] name | f64 position[3] (m) | f64 quaternion[4] (x, y, z, w)``. A lost datagram
costs its updates.
"""

import math
import socket
import struct
from collections import deque
from collections.abc import Iterable
from typing import NamedTuple

from mocap_bridge.rotation import slerp
from onboard.arrays import Quaternion, Vector
from onboard.closing import Closing
from sim_backend.errors import SimulationError

_HEADER = struct.Struct("<IHHd")
_BODY = struct.Struct("<24s7d")
_MAGIC = int.from_bytes(b"PFD1", "little")
ANSWER = 1
"""Flag: the room shall say when the update is dealt with (:mod:`sim_backend.room.driven_feed`)."""
# Updates kept to place an exposure between two of them; longer than any camera latency that is simulated.
_HISTORY_S = 0.25


class FeedError(SimulationError):
    """A datagram on the feed port that is not a feed datagram, or a body that does not fit one."""


class TruePose(NamedTuple):
    """Where a body really is: position (m), quaternion (x, y, z, w)."""

    position: Vector
    quaternion: Quaternion


class FeedUpdate(NamedTuple):
    """All bodies at one world time."""

    world_time: float
    bodies: dict[str, TruePose]
    flags: int = 0


def encode_feed(update: FeedUpdate, *, answer: bool = False) -> bytes:
    """The datagram of `update`.

    Raises:
        FeedError: a name over 24 bytes, or a pose that is not seven finite numbers.
    """
    data = bytearray(_HEADER.pack(_MAGIC, len(update.bodies), ANSWER if answer else 0, update.world_time))
    for name, pose in update.bodies.items():
        encoded = name.encode()
        values = (*pose.position, *pose.quaternion)
        if len(encoded) > 24 or len(values) != 7 or not all(map(math.isfinite, values)):
            raise FeedError(
                f"body {name!r} at {values} cannot be fed: name up to 24 bytes, seven finite numbers"
            )
        data += _BODY.pack(encoded, *values)
    return bytes(data)


def decode_feed(data: bytes) -> list[FeedUpdate]:
    """The updates in a datagram, one or more, as they follow each other.

    Raises:
        FeedError: wrong magic, length or values.
    """
    updates: list[FeedUpdate] = []
    position = 0
    while position < len(data) or not updates:
        update, position = _update_at(data, position)
        updates.append(update)
    return updates


def _update_at(data: bytes, start: int) -> tuple[FeedUpdate, int]:
    """The update that begins at byte `start`, and where it ends."""
    if len(data) - start < _HEADER.size:
        raise FeedError(f"feed datagram of {len(data)} bytes has no header at byte {start}")
    magic, count, flags, world_time = _HEADER.unpack_from(data, start)
    place = start + _HEADER.size
    end = place + count * _BODY.size
    if magic != _MAGIC or len(data) < end or not math.isfinite(world_time):
        raise FeedError(f"not a feed datagram: magic {magic:#x}, {count} bodies in {len(data)} bytes")
    bodies = {}
    for i in range(count):
        name, *values = _BODY.unpack_from(data, place + i * _BODY.size)
        if not all(map(math.isfinite, values)):
            raise FeedError(f"body {i} of the feed datagram has values {values}")
        pose = TruePose((values[0], values[1], values[2]), (values[3], values[4], values[5], values[6]))
        bodies[name.rstrip(b"\0").decode("utf-8", "replace")] = pose
    return FeedUpdate(world_time, bodies, flags), end


class FeedSender(Closing):
    """The world's end of the feed. Never blocks: a datagram that cannot go now is given up."""

    def __init__(self, port: int, host: str = "127.0.0.1") -> None:
        self._address = (host, port)
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.setblocking(False)

    def send(self, world_time: float, bodies: Iterable[tuple[str, Vector, Quaternion]]) -> bool:
        """Send all bodies at `world_time`; False when the system did not take the datagram."""
        update = FeedUpdate(world_time, {name: TruePose(p, q) for name, p, q in bodies})
        try:
            self._socket.sendto(encode_feed(update), self._address)
        except (BlockingIOError, ConnectionRefusedError):
            return False
        return True

    def close(self) -> None:
        """Close the socket."""
        self._socket.close()


class FeedReceiver:
    """The room's end: remembers the newest updates and says where bodies were at a time of the local clock.

    World time runs at the pace of the local clock but starts elsewhere and arrives with varying delay; the
    smallest difference of the last quarter second is taken as the true one.
    """

    def __init__(self, timeout: float) -> None:
        self._timeout = timeout
        self._updates: deque[tuple[float, FeedUpdate]] = deque()

    def observe(self, update: FeedUpdate, receipt_time: float) -> None:
        """Take in an update that arrived at `receipt_time` (s); a world time that runs back starts afresh."""
        updates = self._updates
        if updates and update.world_time < updates[-1][1].world_time:
            updates.clear()
        updates.append((receipt_time, update))
        while updates[0][0] < receipt_time - _HISTORY_S:
            updates.popleft()

    def world_time(self, local_time: float) -> float | None:
        """World time at `local_time`, not beyond the newest update; None before the first."""
        if not self._updates:
            return None
        offset = min(receipt - update.world_time for receipt, update in self._updates)
        return min(local_time - offset, self._updates[-1][1].world_time)

    def bodies_at(self, local_time: float) -> dict[str, TruePose]:
        """Poses at `local_time`, interpolated between updates; empty when the feed has fallen silent."""
        world_time = self.world_time(local_time)
        if world_time is None or local_time - self._updates[-1][0] > self._timeout:
            return {}
        later = self._updates[-1][1]
        for _, earlier in reversed(self._updates):
            if earlier.world_time <= world_time:
                return _between(earlier, later, world_time)
            later = earlier
        return later.bodies


def _between(earlier: FeedUpdate, later: FeedUpdate, world_time: float) -> dict[str, TruePose]:
    span = later.world_time - earlier.world_time
    if span <= 0.0:
        return later.bodies
    fraction = (world_time - earlier.world_time) / span
    return {
        name: _interpolate(earlier.bodies[name], pose, fraction) if name in earlier.bodies else pose
        for name, pose in later.bodies.items()
    }


def _interpolate(a: TruePose, b: TruePose, fraction: float) -> TruePose:
    x, y, z = (p + fraction * (q - p) for p, q in zip(a.position, b.position, strict=True))
    return TruePose((x, y, z), slerp(a.quaternion, b.quaternion, fraction))
