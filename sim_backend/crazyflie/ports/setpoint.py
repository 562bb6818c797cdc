"""Ports 3 and 7, setpoints (``crtp_commander.c``, ``crtp_commander_rpyt.c``, ``crtp_commander_generic.c``).

port 3, channel 0::

    f32 roll, -pitch [deg], yaw rate [deg/s], u16 thrust

port 7, channel 0: type byte and data; the firmware asserts the length of the data, also in flight::

     0 stop, any length          6 full state <9h I 3h       (mm, mm/s, mm/s2, quaternion, mrad/s)
     1 velocity <4f (legacy)     7 position <4f, not checked (m, yaw deg)
     2 z distance <4f (legacy)   8 velocity in the world <4f
     3 cppm, 9 + 2 n             9 z distance <4f
     4 altitude hold <4f        10 hover <4f
     5 hover <4f (legacy)       11 manual <fffHB

port 7, channel 1::

    00 u32 milliseconds         no more setpoints will come; the high-level commander may take over

A type that does not exist is a null setpoint. Bytes missing in a type that is not checked read as zero.
Nothing is answered.
"""

import struct

from sim_backend.crazyflie.crtp import Packet
from sim_backend.crazyflie.interfaces import CommanderPort, FirmwareAssertion

RPYT_LENGTH = struct.calcsize("<fffH")
POSITION_LENGTH = struct.calcsize("<4f")
LENGTHS = {
    **dict.fromkeys((1, 2, 4, 5, 8, 9, 10), struct.calcsize("<4f")),
    6: struct.calcsize("<9hI3h"),
    11: struct.calcsize("<fffHB"),
}
CPPM, POSITION = 3, 7
CPPM_SHORTEST = 9
NOTIFY_STOP_LENGTH = 4


class RpytPort:
    """Port 3."""

    def __init__(self, commander: CommanderPort) -> None:
        """Setpoints go to ``commander``."""
        self._commander = commander

    def handle(self, packet: Packet) -> None:
        """One packet of the client."""
        if packet.channel == 0:
            self._commander.setpoint_rpyt(packet.padded(RPYT_LENGTH)[:RPYT_LENGTH])


class GenericSetpointPort:
    """Port 7."""

    def __init__(self, commander: CommanderPort) -> None:
        """Setpoints go to ``commander``."""
        self._commander = commander

    def handle(self, packet: Packet) -> None:
        """One packet of the client.

        Raises:
            FirmwareAssertion: the length is not that of the type.
        """
        if packet.channel == 0:
            check_setpoint_length(packet.payload)
            payload = packet.payload
            if payload[0] == POSITION:
                payload = packet.padded(1 + POSITION_LENGTH)[: 1 + POSITION_LENGTH]
            self._commander.setpoint_generic(payload)
        elif packet.channel == 1 and packet.padded(1)[0] == 0:
            if len(packet.payload) != 1 + NOTIFY_STOP_LENGTH:
                raise FirmwareAssertion(f"crtp_commander.c: notify stop with {len(packet.payload)} bytes")
            self._commander.notify_setpoints_stop(int.from_bytes(packet.payload[1:], "little"))


def check_setpoint_length(payload: bytes) -> None:
    """Assert what the firmware asserts of a generic setpoint.

    Raises:
        FirmwareAssertion: the length is not that of the type.
    """
    if not payload:
        raise FirmwareAssertion("crtp_commander_generic.c: setpoint without a type")
    kind, length = payload[0], len(payload) - 1
    if kind == CPPM:
        expected = CPPM_SHORTEST + 2 * (payload[1] & 0x0F) if length >= CPPM_SHORTEST else CPPM_SHORTEST
    else:
        expected = LENGTHS.get(kind, length)
    if length != expected:
        raise FirmwareAssertion(
            f"crtp_commander_generic.c: setpoint type {kind} with {length} bytes instead of {expected}"
        )
