"""Port 9, supervisor (``crtp_supervisor.c``); an answer carries the command with bit 7 set.

channel 0, information::

    01..0B          -> 81..8B u8            bits 0..10 of the state, one by one
    0C              -> 8C u16               all bits (``onboard.supervisor_info``)

channel 1, commands::

    01 u8 arm       -> 81 success armed     arm or disarm
    02              -> 82 success recovered leave the crashed state
    03              (no answer)             emergency stop
    04              (no answer)             kick the emergency stop watchdog

The information is what the supervisor wrote in its last update (25 Hz); the answers to commands are of now.
"""

from enum import IntEnum

from sim_backend.crazyflie.crtp import Packet
from sim_backend.crazyflie.interfaces import SupervisorPort
from sim_backend.crazyflie.ports import Send

RESPONSE = 0x80
FIRST_BIT_COMMAND, LAST_BIT_COMMAND, BITFIELD_COMMAND = 0x01, 0x0B, 0x0C


class SupervisorChannel(IntEnum):
    """Channels of port 9."""

    INFO = 0
    COMMAND = 1


class SupervisorCommand(IntEnum):
    """Commands of channel 1."""

    ARM = 1
    RECOVER = 2
    EMERGENCY_STOP = 3
    EMERGENCY_STOP_WATCHDOG = 4


class SupervisorCrtpPort:
    """Answers port 9 through the firmware's supervisor."""

    def __init__(self, supervisor: SupervisorPort, send: Send) -> None:
        """Answer through ``send``."""
        self._supervisor = supervisor
        self._send = send

    def handle(self, packet: Packet) -> None:
        """One packet of the client."""
        if not packet.payload:
            return
        if packet.channel == SupervisorChannel.INFO:
            self._info(packet)
        elif packet.channel == SupervisorChannel.COMMAND:
            self._command(packet)

    def _info(self, packet: Packet) -> None:
        command = packet.payload[0]
        bits = self._supervisor.info_bits()
        if command == BITFIELD_COMMAND:
            self._send(packet.reply(bytes([RESPONSE | command]) + (bits & 0xFFFF).to_bytes(2, "little")))
        elif FIRST_BIT_COMMAND <= command <= LAST_BIT_COMMAND:
            self._send(packet.reply(bytes([RESPONSE | command, bits >> command - 1 & 1])))

    def _command(self, packet: Packet) -> None:
        command, argument = packet.padded(2)[:2]
        if command == SupervisorCommand.ARM:
            self._send(packet.reply(bytes([RESPONSE | command, *arm(self._supervisor, bool(argument))])))
        elif command == SupervisorCommand.RECOVER:
            self._send(packet.reply(bytes([RESPONSE | command, *recover(self._supervisor)])))
        elif command == SupervisorCommand.EMERGENCY_STOP:
            self._supervisor.emergency_stop()
        elif command == SupervisorCommand.EMERGENCY_STOP_WATCHDOG:
            self._supervisor.kick_emergency_stop_watchdog()


def arm(supervisor: SupervisorPort, on: bool) -> tuple[bool, bool]:
    """Ask for arming or disarming; (accepted, armed now)."""
    accepted = supervisor.arm(on)
    return accepted, supervisor.is_armed


def recover(supervisor: SupervisorPort) -> tuple[bool, bool]:
    """Ask for recovery from a crash; (accepted, not crashed now)."""
    accepted = supervisor.recover()
    return accepted, not supervisor.is_crashed
