"""Port 8, high-level commander (``crtp_commander_high_level.c``). All channels are the same.

client to drone: command byte and data; m, rad, s::

     0 u8 mask                                        group mask (deprecated)
     1, 2 u8 group, f32 height, duration              take off, land (deprecated)
     3 u8 group                                       stop
     4 u8 group, relative, f32 x y z yaw duration     go to (deprecated)
     5 u8 group, relative, reversed, id, f32 scale    start trajectory (deprecated)
     6 u8 id, location, type, u32 offset, u8 pieces   define trajectory
     7, 8 u8 group, f32 height, yaw, u8 current yaw, f32 duration        take off, land
     9, 10 u8 group, f32 height, u8 relative, f32 yaw, u8 current yaw, f32 velocity
    11 u8 group, sideways, clockwise, f32 phi r0 rf dz duration          spiral
    12 u8 group, relative, linear, f32 x y z yaw duration                go to
    13 u8 group, relative position, relative yaw, reversed, id, f32 scale    start trajectory

drone to client: the first three bytes as they came, errno: 0, EBUSY 16 (not allowed to fly), ENOEXEC 8.

A command whose data is too short is refused with ENOEXEC (the firmware executes it with whatever its buffer
held before); bytes too many are ignored.
"""

import struct

from sim_backend.crazyflie.crtp import Packet
from sim_backend.crazyflie.interfaces import ENOEXEC, CommanderPort
from sim_backend.crazyflie.ports import Send

FORMATS = {
    0: "<B",
    1: "<Bff",
    2: "<Bff",
    3: "<B",
    4: "<BB5f",
    5: "<BBBBf",
    6: "<BBBIB",
    7: "<BffBf",
    8: "<BffBf",
    9: "<BfBfBf",
    10: "<BfBfBf",
    11: "<BBB5f",
    12: "<BBB5f",
    13: "<BBBBBf",
}
LENGTHS = {command: struct.calcsize(layout) for command, layout in FORMATS.items()}


class HighLevelPort:
    """Answers port 8 through the firmware's commander."""

    def __init__(self, commander: CommanderPort, send: Send) -> None:
        """Answer through ``send``."""
        self._commander = commander
        self._send = send

    def handle(self, packet: Packet) -> None:
        """One packet of the client."""
        command, data = packet.padded(1)[0], packet.payload[1:]
        length = LENGTHS.get(command)
        if length is None or len(data) < length:
            error = ENOEXEC
        else:
            error = self._commander.high_level(command, data[:length])
        self._send(packet.reply(packet.padded(3)[:3] + bytes([error & 0xFF])))
