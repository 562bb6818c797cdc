"""Port 13, platform (``platformservice.c``).

channel 0, commands, answered with the packet itself except where noted::

    00 u8           continuous wave (no effect here)
    01 u8 arm       -> 01 success armed         legacy arming; without argument: 01 00 armed
    02              -> 02 success recovered     legacy recovery
    03 u8           -> (empty)                  user notification

channel 1, versions::

    00              -> 00 u32 protocol version
    01              -> 01 firmware tag
    02              -> 02 device name

channel 2, app channel: our app does not listen, packets are dropped.
"""

import struct
from enum import IntEnum

from sim_backend.crazyflie.crtp import PAYLOAD_MAX, Packet
from sim_backend.crazyflie.interfaces import SupervisorPort
from sim_backend.crazyflie.ports import Send
from sim_backend.crazyflie.ports.supervisor import arm, recover

PROTOCOL_VERSION = 12
FIRMWARE_TAG = b"2026.08 +2"
DEVICE_NAME = b"Crazyflie 2.1"


class PlatformChannel(IntEnum):
    """Channels of port 13."""

    COMMAND = 0
    VERSION = 1
    APP = 2


class PlatformCommand(IntEnum):
    """Commands of channel 0 that do something here."""

    ARM = 1
    RECOVER = 2
    USER_NOTIFICATION = 3


class PlatformPort:
    """Answers port 13."""

    def __init__(self, supervisor: SupervisorPort, send: Send) -> None:
        """Answer through ``send``; legacy arming goes to ``supervisor``."""
        self._supervisor = supervisor
        self._send = send
        self._versions = {
            0: struct.pack("<I", PROTOCOL_VERSION),
            1: FIRMWARE_TAG[: PAYLOAD_MAX - 1],
            2: DEVICE_NAME[: PAYLOAD_MAX - 1],
        }

    def handle(self, packet: Packet) -> None:
        """One packet of the client."""
        command, argument = packet.padded(2)[:2]
        if packet.channel == PlatformChannel.COMMAND:
            self._send(packet.reply(self._command(command, argument, packet.payload)))
        elif packet.channel == PlatformChannel.VERSION and command in self._versions:
            self._send(packet.reply(bytes([command]) + self._versions[command]))

    def _command(self, command: int, argument: int, payload: bytes) -> bytes:
        if command == PlatformCommand.ARM:
            on = bool(argument)
            if len(payload) < 2:
                return bytes([command, 0, self._supervisor.is_armed])
            return bytes([command, *arm(self._supervisor, on)])
        if command == PlatformCommand.RECOVER:
            return bytes([command, *recover(self._supervisor)])
        if command == PlatformCommand.USER_NOTIFICATION:
            return b""
        return payload
