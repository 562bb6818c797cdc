"""A UDP socket that speaks MAVLink 2: packs, signs and sends, receives and checks. It never blocks."""

import selectors
import socket
import struct
import threading
import time
from collections.abc import Iterator
from typing import Any, NamedTuple

from pymavlink.dialects.v20 import common

from mocap_bridge.errors import SourceLost
from onboard.taken_port import why_not_taken

MESSAGES: Any = common
"""The dialect: message classes ``MAVLink_..._message`` and constants ``MAV_...``."""

Address = tuple[Any, ...]

_RECEIVE_BYTES = 2048
_BURST = 200
_SIGNING_EPOCH_S = 1_420_070_400
"""1 January 2015 UTC, from which signatures count in 10 us (https://mavlink.io/en/guide/message_signing.html)."""


class ReceivedMessage(NamedTuple):
    """A message, who sent it (system, component) and from where."""

    message: Any
    system: int
    component: int
    source: Address


class MavlinkEndpoint:
    """One socket. Sending is safe from several threads, receiving from one.

    Args:
        system, component: who we are.
        key: signs what is sent, and refuses what is not signed with it; None: neither.
        listen: local host and port to bind, for who is spoken to first; else any free port.

    Attributes:
        lost: packets that could not be sent (nobody there, buffer full, no such number): they are gone.
        refused: packets that were not MAVLink, damaged, or not signed with the key.

    Raises:
        SourceLost: the port cannot be taken.
    """

    def __init__(
        self,
        system: int,
        component: int,
        *,
        key: bytes | None = None,
        listen: tuple[str, int] | None = None,
        ipv6: bool = False,
    ) -> None:
        self.lost = 0
        self.refused = 0
        self._socket = socket.socket(socket.AF_INET6 if ipv6 else socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.setblocking(False)
        if listen is not None:
            try:
                self._socket.bind(listen)
            except OSError as error:
                self._socket.close()
                host, port = listen
                raise SourceLost(
                    f"cannot listen for MAVLink: {why_not_taken(error, 'UDP', host, port)}; does another "
                    "perchhw or a ground station listen there? End that, or send to another port"
                ) from error
        self._selector = selectors.DefaultSelector()
        self._selector.register(self._socket, selectors.EVENT_READ)
        self._lock = threading.Lock()
        self._out = self._codec(system, component, key)
        self._in = self._codec(system, component, key)

    @staticmethod
    def _codec(system: int, component: int, key: bytes | None) -> Any:
        codec = MESSAGES.MAVLink(None, srcSystem=system, srcComponent=component)
        codec.robust_parsing = True
        if key is not None:
            codec.signing.secret_key = key
            codec.signing.sign_outgoing = True
            # The calendar: a signature must be newer than the last one, also that of an earlier process.
            codec.signing.timestamp = int((time.time() - _SIGNING_EPOCH_S) * 1e5)
        return codec

    @property
    def port(self) -> int:
        """The local UDP port."""
        return int(self._socket.getsockname()[1])

    def send(self, message: Any, to: Address) -> None:
        """Send one message; one that cannot be sent now is lost and counted."""
        with self._lock:
            try:
                self._socket.sendto(message.pack(self._out), to)
            except (OSError, OverflowError, struct.error):  # the last two: a number that no field can hold
                self.lost += 1
            self._out.seq = (self._out.seq + 1) % 256

    def wait(self, timeout_s: float) -> None:
        """Wait until something arrives, at most `timeout_s`."""
        self._selector.select(timeout_s)

    def receive(self) -> Iterator[ReceivedMessage]:
        """What has arrived, whole messages only."""
        for _ in range(_BURST):
            try:
                data, source = self._socket.recvfrom(_RECEIVE_BYTES)
            except BlockingIOError:
                return
            except OSError:  # an ICMP answer to what was sent: nobody listens there
                continue
            for message in self._in.parse_buffer(data) or ():
                if message.get_type() == "BAD_DATA":
                    self.refused += 1
                elif not message.get_type().startswith("UNKNOWN"):
                    yield ReceivedMessage(
                        message, message.get_srcSystem(), message.get_srcComponent(), source
                    )

    def close(self) -> None:
        """Close the socket."""
        self._selector.close()
        self._socket.close()
