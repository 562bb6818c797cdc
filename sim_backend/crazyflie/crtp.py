"""CRTP packets, as bytes and as values.

One UDP datagram (or radio packet) is one packet::

    +--------+----------------+
    | header | payload, 0..30 |    header = port << 4 | reserved << 2 | channel
    +--------+----------------+

The reserved bits carry the radio's sequence numbers; they are ignored on receipt and sent as zeros. A
packet of port 15, channel 3 belongs to the radio chip (nRF51) and never reaches the ports: alone it is
the null packet (a poll), with payload ``FE xx`` a power command. Source: bitcraze/crazyflie-firmware
2a18fc29 ``crtp.h`` and bitcraze/crazyflie2-nrf-firmware ``main.c``.
"""

from dataclasses import dataclass
from enum import IntEnum
from typing import Self

PAYLOAD_MAX = 30

#: What an unused or not yet written byte of a packet reads as. (The firmware reads what its buffer held
#: before.)
FILL = b"\0"


class Port(IntEnum):
    """CRTP ports."""

    CONSOLE = 0
    PARAM = 2
    SETPOINT = 3
    MEMORY = 4
    LOG = 5
    LOCALIZATION = 6
    SETPOINT_GENERIC = 7
    SETPOINT_HIGH_LEVEL = 8
    SUPERVISOR = 9
    PLATFORM = 13
    LINK = 15


RADIO_CHANNEL = 3


@dataclass(frozen=True, slots=True)
class Packet:
    """One packet: port 0..15, channel 0..3, payload of at most 30 bytes."""

    port: int
    channel: int
    payload: bytes = b""

    @classmethod
    def decode(cls, datagram: bytes) -> Self | None:
        """The packet in a datagram, or ``None`` when its length is not that of a packet (1 to 31 bytes)."""
        if not 1 <= len(datagram) <= 1 + PAYLOAD_MAX:
            return None
        return cls(datagram[0] >> 4, datagram[0] & 0x03, bytes(datagram[1:]))

    def encode(self) -> bytes:
        """The datagram."""
        return bytes([self.port << 4 | self.channel]) + self.payload

    @property
    def for_radio(self) -> bool:
        """Meant for the radio chip: null packets and power commands."""
        return self.port == Port.LINK and self.channel == RADIO_CHANNEL

    @property
    def is_null(self) -> bool:
        """A poll without content."""
        return self.for_radio and not self.payload

    def padded(self, length: int) -> bytes:
        """The payload with at least ``length`` bytes."""
        return self.payload.ljust(length, FILL)

    def reply(self, payload: bytes) -> "Packet":
        """A packet back on the same port and channel."""
        return Packet(self.port, self.channel, payload)


#: The answer of the radio to a poll when the drone has nothing to say.
NULL = b"\xff"
