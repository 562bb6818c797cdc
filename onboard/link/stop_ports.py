"""Where a stop leaves for a ``udp://`` drone: a duplicate of a socket, which nobody else can close."""

import contextlib
import socket
from collections.abc import Callable

_DATAGRAM_MAX = 31
_SENDS = 2


def _nobody() -> bool:
    return False


class UdpStopPort:
    """A :class:`onboard.link.stop.StopPort` on a UDP socket.

    Args:
        udp: a connected socket; it is duplicated.
        read_elsewhere: whether somebody else reads the socket, and gives what comes to :meth:`take`.
        sent: told of every packet that left, after it did.
    """

    def __init__(
        self,
        udp: socket.socket,
        read_elsewhere: Callable[[], bool] = _nobody,
        sent: Callable[[int], None] = lambda _packets: None,
    ) -> None:
        self._socket = udp.dup()
        self._socket.setblocking(False)
        self._read_elsewhere = read_elsewhere
        self._sent = sent
        self._listener: Callable[[bytes], None] | None = None

    def stop(self, packet: bytes) -> None:
        """Send; nothing waits before it."""
        # A refusal is the answer to an earlier packet and costs this one its place: so it is sent again.
        for _ in range(_SENDS):
            try:
                self._socket.send(packet)
            except OSError:
                continue
            self._sent(1)
            return

    ask = stop

    def listen(self, take: Callable[[bytes], None]) -> None:
        """Give packets to `take`."""
        self._listener = take

    def take(self, packet: bytes) -> None:
        """A packet that somebody else has read."""
        if self._listener is not None:
            self._listener(packet)

    def poll(self) -> None:
        """Read what has come, unless somebody else does."""
        if self._read_elsewhere():
            return
        with contextlib.suppress(OSError):  # nothing more, or refused: both are silence
            while True:
                self.take(self._socket.recv(_DATAGRAM_MAX))

    def close(self) -> None:
        """Close the duplicate."""
        self._socket.close()
