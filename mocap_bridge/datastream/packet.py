"""Packets of the DataStream: a magic, a length, and blocks; each block is one object.

``packet = u32 magic | u32 nbytes | block*``, ``block = u32 object id | u32 nbytes | payload``. The lengths do
not count their own eight bytes. All objects of one frame travel in one packet.
"""

import struct
from collections.abc import Collection, Iterable
from functools import lru_cache

from mocap_bridge.datastream.fields import PayloadReader
from mocap_bridge.datastream.objects import (
    LAYOUTS,
    OBJECT_IDS,
    ApplicationInfo,
    StreamInfo,
    StreamObject,
    SubjectInfo,
)
from mocap_bridge.errors import PacketError

MAGIC = 0x1A2B0001
# A frame of 30 bodies takes 8.7 kB; a length beyond this is a broken or foreign stream.
PACKET_BYTES_LIMIT = 1024 * 1024

_HEADER = struct.Struct("<II")
_STANDING = frozenset(OBJECT_IDS[kind] for kind in (StreamInfo, ApplicationInfo, SubjectInfo))
"""Sent with every frame, and the same in nearly all: each is decoded once."""


def encode_packet(objects: Iterable[StreamObject]) -> bytes:
    """One packet with the objects in the order given.

    Raises:
        PacketError: a value does not fit its field.
    """
    return join_blocks(encode_block(item) for item in objects)


def encode_block(item: StreamObject) -> bytes:
    """One object as a block, for packets put together from blocks that are encoded once."""
    object_id = OBJECT_IDS[type(item)]
    payload = bytearray()
    LAYOUTS[object_id].write(item, payload)
    return _HEADER.pack(object_id, len(payload)) + bytes(payload)


def join_blocks(blocks: Iterable[bytes]) -> bytes:
    """One packet of encoded blocks."""
    body = b"".join(blocks)
    return _HEADER.pack(MAGIC, len(body)) + body


def decode_packet(data: bytes, wanted: Collection[int] | None = None) -> list[StreamObject]:
    """The objects of one complete packet; unknown ids, and ids not in `wanted`, are stepped over.

    Raises:
        PacketError: wrong magic or length, a block beyond the packet, a payload that does not fit its object.
    """
    if len(data) < _HEADER.size:
        raise PacketError(f"packet of {len(data)} bytes has no complete header")
    end = _HEADER.size + packet_body_bytes(data, 0)
    if end != len(data):
        raise PacketError(f"packet says {end} bytes and has {len(data)}")
    objects: list[StreamObject] = []
    position = _HEADER.size
    while position < end:
        if position + _HEADER.size > end:
            raise PacketError(f"block header cut off at byte {position} of {end}")
        object_id, size = _HEADER.unpack_from(data, position)
        position += _HEADER.size
        if position + size > end:
            raise PacketError(
                f"object {object_id} says {size} bytes, {end - position} are left in the packet"
            )
        if object_id in LAYOUTS and (wanted is None or object_id in wanted):
            if object_id in _STANDING:
                objects.append(_standing(object_id, data[position : position + size]))
            else:
                objects.append(_decoded(object_id, data, position, position + size))
        position += size
    return objects


def _decoded(object_id: int, data: bytes, start: int, end: int) -> StreamObject:
    reader = PayloadReader(data, start, end)
    item: StreamObject = LAYOUTS[object_id].read(reader)
    if reader.position != reader.end:
        raise PacketError(f"object {object_id} leaves {reader.end - reader.position} bytes unread")
    return item


@lru_cache(maxsize=256)
def _standing(object_id: int, payload: bytes) -> StreamObject:
    return _decoded(object_id, payload, 0, len(payload))


def packet_body_bytes(data: bytes | bytearray, start: int) -> int:
    """Length of the body of the packet whose eight header bytes begin at `start`.

    Raises:
        PacketError: wrong magic, or a length beyond PACKET_BYTES_LIMIT.
    """
    magic, size = _HEADER.unpack_from(data, start)
    if magic != MAGIC:
        raise PacketError(f"packet starts with {magic:#010x}, not {MAGIC:#010x}: not a Vicon DataStream")
    if size > PACKET_BYTES_LIMIT:
        raise PacketError(f"packet length {size} is over the limit of {PACKET_BYTES_LIMIT} bytes")
    return int(size)


class PacketBuffer:
    """Cuts a byte stream into packets. Never holds more than one packet and one receive beyond it."""

    def __init__(self) -> None:
        self._data = bytearray()

    def feed(self, data: bytes) -> None:
        """Add what a socket delivered."""
        self._data += data

    def next_packet(self) -> bytes | None:
        """The next complete packet, or None until more bytes arrive.

        Raises:
            PacketError: the stream is not, or no longer, a DataStream; it cannot be resynchronised.
        """
        if len(self._data) < _HEADER.size:
            return None
        size = _HEADER.size + packet_body_bytes(self._data, 0)
        if len(self._data) < size:
            return None
        packet = bytes(self._data[:size])
        del self._data[:size]
        return packet
