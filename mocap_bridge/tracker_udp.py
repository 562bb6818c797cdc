"""Codec of Vicon Tracker's UDP object stream: datagrams to named poses and back, no sockets.

Little-endian, packed: ``u32 frame | u8 items | item*``, zero-padded to exactly 256, 512 or 1024 bytes; an
item is ``u8 id (0) | u16 size (72) | char[24] name | f64 x, y, z (mm) | f64 rx, ry, rz (rad)`` with ``R = Rx
Ry Rz``, body to world. There is no time, rate, quality or latency. Facts: UoBFlightLab/vicon_udp, BoB
robotics, MARSlab docs.
"""

import math
import struct
from collections.abc import Sequence
from typing import NamedTuple

from mocap_bridge.errors import PacketError
from onboard.arrays import Vector

BLOCK_SIZES = (256, 512, 1024)
NAME_BYTES = 23
_HEADER = struct.Struct("<IB")
_ITEM = struct.Struct("<BH24s6d")
_ITEM_SIZE_FIELD = 72


class TrackerItem(NamedTuple):
    """One object: name, position (mm), angles rx, ry, rz (rad)."""

    name: str
    position: Vector
    angles: Vector

    def has_pose(self) -> bool:
        """False for the two ways in which an occluded object is sent: all zeros, and NaN."""
        values = (*self.position, *self.angles)
        return all(math.isfinite(value) for value in values) and any(value != 0.0 for value in values)


class TrackerBlock(NamedTuple):
    """One datagram; the objects of a frame may be spread over several with the same frame number."""

    frame: int
    items: tuple[TrackerItem, ...]


def block_capacity(block_size: int) -> int:
    """How many objects fit a datagram of `block_size` bytes."""
    return (block_size - _HEADER.size) // _ITEM.size


def encode_blocks(frame: int, items: Sequence[TrackerItem], block_size: int = 1024) -> list[bytes]:
    """The datagrams of one frame, at least one; names are cut to 23 bytes as Tracker does."""
    if block_size not in BLOCK_SIZES:
        raise PacketError(f"block size {block_size} is not one of {BLOCK_SIZES}")
    capacity = block_capacity(block_size)
    chunks = [items[i : i + capacity] for i in range(0, len(items), capacity)] or [items]
    return [_encode_block(frame, chunk, block_size) for chunk in chunks]


def _encode_block(frame: int, items: Sequence[TrackerItem], block_size: int) -> bytes:
    block = bytearray(_HEADER.pack(frame & 0xFFFFFFFF, len(items)))
    for item in items:
        name = item.name.encode()[:NAME_BYTES]
        block += _ITEM.pack(0, _ITEM_SIZE_FIELD, name, *item.position, *item.angles)
    return bytes(block.ljust(block_size, b"\0"))


def decode_block(data: bytes) -> TrackerBlock:
    """One datagram.

    Raises:
        PacketError: not a block size, or more items than it can hold, or an item of another kind.
    """
    if len(data) not in BLOCK_SIZES:
        raise PacketError(f"datagram of {len(data)} bytes; Tracker sends {BLOCK_SIZES}")
    frame, count = _HEADER.unpack_from(data, 0)
    if count > block_capacity(len(data)):
        raise PacketError(f"{count} items do not fit a datagram of {len(data)} bytes")
    items = []
    for i in range(count):
        kind, size, name, *values = _ITEM.unpack_from(data, _HEADER.size + i * _ITEM.size)
        if kind != 0 or size != _ITEM_SIZE_FIELD:
            raise PacketError(f"item {i} has id {kind} and size {size}; Tracker objects have 0 and 72")
        text = name.split(b"\0", 1)[0].decode("utf-8", "replace")
        items.append(TrackerItem(text, (values[0], values[1], values[2]), (values[3], values[4], values[5])))
    return TrackerBlock(frame, tuple(items))
