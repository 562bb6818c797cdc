"""Port 15, link (``crtpservice.c``); channel 3 belongs to the radio chip, see :mod:`.radio`.

    channel 0       -> the packet itself (echo)
    channel 1       -> "Bitcraze Crazyflie", zeros up to 30 bytes
    channel 2       nothing (sink)

The parameter ``crtpsrv.echoDelay`` has no effect here.
"""

from enum import IntEnum

from sim_backend.crazyflie.crtp import PAYLOAD_MAX, Packet
from sim_backend.crazyflie.ports import Send

SOURCE = b"Bitcraze Crazyflie".ljust(PAYLOAD_MAX, b"\0")


class LinkChannel(IntEnum):
    """Channels of port 15 that the firmware answers."""

    ECHO = 0
    SOURCE = 1


class LinkPort:
    """Answers port 15."""

    def __init__(self, send: Send) -> None:
        """Answer through ``send``."""
        self._send = send

    def handle(self, packet: Packet) -> None:
        """One packet of the client."""
        if packet.channel == LinkChannel.ECHO:
            self._send(packet)
        elif packet.channel == LinkChannel.SOURCE:
            self._send(packet.reply(SOURCE))
