"""Port 6, localization (``crtp_localization_service.c``). Nothing is answered except where noted.

channel 0, position::

    f32 x, y, z [m]

channel 1, by type::

    08 f32 x, y, z [m], qx, qy, qz, qw              pose
    09 {u8 id, i16 x, y, z [mm], u32 quaternion}*   poses of several drones, two in a packet
    02 destination data                             -> 02 destination 00: there is no positioning deck
    03                                              emergency stop (legacy)
    04                                              emergency stop watchdog (legacy)
    0B u16 u16                                      -> 0B 01: lighthouse data stored

channel 2, positions of several drones::

    {u8 id, i16 x, y, z [mm]}*                      four in a packet

``id`` is the last byte of the radio address; entries of other drones are left alone. A position or pose
that is too short is ignored (the firmware fills it with what its buffer held before). Values are not
checked.
"""

import math
import struct
from enum import IntEnum

from sim_backend.crazyflie.crtp import Packet
from sim_backend.crazyflie.interfaces import Localization
from sim_backend.crazyflie.ports import Send

POSITION = struct.Struct("<3f")
POSE = struct.Struct("<7f")
PACKED_POSITION = struct.Struct("<B3h")
PACKED_POSE = struct.Struct("<B3hI")
MM = 1e-3


class LocalizationChannel(IntEnum):
    """Channels of port 6."""

    POSITION = 0
    GENERIC = 1
    POSITION_PACKED = 2


class Generic(IntEnum):
    """Types of channel 1."""

    SHORT_LPP = 2
    EMERGENCY_STOP = 3
    EMERGENCY_STOP_WATCHDOG = 4
    POSE = 8
    POSE_PACKED = 9
    LIGHTHOUSE_PERSIST = 11


class LocalizationPort:
    """Hands external measurements to the firmware."""

    def __init__(self, localization: Localization, radio_id: int, send: Send) -> None:
        """``radio_id`` is the last byte of the drone's radio address."""
        self._localization = localization
        self._radio_id = radio_id
        self._send = send

    def handle(self, packet: Packet) -> None:
        """One packet of the client."""
        if packet.channel == LocalizationChannel.POSITION:
            if len(packet.payload) >= POSITION.size:
                self._localization.external_position(*POSITION.unpack_from(packet.payload))
        elif packet.channel == LocalizationChannel.GENERIC:
            self._generic(packet)
        elif packet.channel == LocalizationChannel.POSITION_PACKED:
            for ident, x, y, z in _items(PACKED_POSITION, packet.payload):
                if ident == self._radio_id:
                    self._localization.external_position(x * MM, y * MM, z * MM)

    def _generic(self, packet: Packet) -> None:
        if not packet.payload:
            return
        kind, body = packet.payload[0], packet.payload[1:]
        if kind == Generic.POSE and len(body) >= POSE.size:
            self._localization.external_pose(*POSE.unpack_from(body))
        elif kind == Generic.POSE_PACKED:
            for ident, x, y, z, packed in _items(PACKED_POSE, body):
                if ident == self._radio_id:
                    self._localization.external_pose(x * MM, y * MM, z * MM, *decompress_quaternion(packed))
        elif kind == Generic.EMERGENCY_STOP:
            self._localization.emergency_stop()
        elif kind == Generic.EMERGENCY_STOP_WATCHDOG:
            self._localization.emergency_stop_watchdog()
        elif kind == Generic.SHORT_LPP and body:
            self._send(packet.reply(bytes([kind, body[0], 0])))
        elif kind == Generic.LIGHTHOUSE_PERSIST and len(body) >= 4:
            self._send(packet.reply(bytes([kind, 1])))


def _items(item: struct.Struct, data: bytes) -> list[tuple[int, ...]]:
    return list(item.iter_unpack(data[: len(data) // item.size * item.size]))


def decompress_quaternion(packed: int) -> tuple[float, float, float, float]:
    """Quaternion (x, y, z, w) of its 32-bit form (``quatcompress.h``).

    Bits 30-31 are the index of the largest component, which is positive and follows from the norm. The
    others follow in order, 10 bits each: sign, and magnitude in units of 1 / (511 sqrt 2). A form whose
    magnitudes leave nothing for the largest component gives NaN there, as the firmware's square root
    does.
    """
    largest = packed >> 30
    values = [0.0, 0.0, 0.0, 0.0]
    others = [index for index in range(4) if index != largest]
    for shift, index in zip((20, 10, 0), others, strict=True):
        bits = packed >> shift & 0x3FF
        magnitude = math.sqrt(0.5) * (bits & 0x1FF) / 511
        values[index] = -magnitude if bits & 0x200 else magnitude
    rest = 1.0 - sum(value * value for value in values)
    values[largest] = math.sqrt(rest) if rest >= 0 else math.nan
    x, y, z, w = values
    return x, y, z, w
