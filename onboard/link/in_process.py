"""``perchhw://NAME``: a drone in its client's process, for tests of code that takes cflib's ``Crazyflie``.

No sockets and no threads of its own. Who serves a name takes each packet as it is sent, and hands out packets
whenever it likes; :meth:`InProcessDriver.settled` says when the client has worked them off, so that a world
can wait for its client. No verb of perchhw takes such an address.
"""

import threading
from collections import deque
from collections.abc import Callable
from typing import Any, Protocol

import cflib.crtp
from cflib.crtp.crtpdriver import CRTPDriver
from cflib.crtp.crtpstack import CRTPPacket
from cflib.crtp.exceptions import WrongUriType

from onboard.link.errors import LinkInputError

SCHEME = "perchhw://"


class InProcessServer(Protocol):
    """The drone's end."""

    def client_came(self, driver: "InProcessDriver") -> None:
        """A client is there: packets for it go to :meth:`InProcessDriver.deliver`."""

    def take(self, datagram: bytes) -> None:
        """A packet of the client: header and payload."""

    def client_left(self, driver: "InProcessDriver") -> None:
        """The client has closed."""


_served: dict[str, InProcessServer] = {}


def serve_in_process(name: str, server: InProcessServer) -> str:
    """Make `server` answer at ``perchhw://NAME``, which is returned, for every cflib of this process.

    Raises:
        LinkInputError: the name is taken.
    """
    if name in _served:
        raise LinkInputError(f"{SCHEME}{name} is served already; close the other lab first")
    _served[name] = server
    if InProcessDriver not in cflib.crtp.CLASSES:
        cflib.crtp.CLASSES.insert(0, InProcessDriver)
    return SCHEME + name


def stop_serving(name: str) -> None:
    """Forget the name; who is connected stays so and gets no answer."""
    _served.pop(name, None)


class InProcessDriver(CRTPDriver):
    """cflib's end of a link in process."""

    def __init__(self) -> None:
        super().__init__()
        self.needs_resending = False
        self._server: InProcessServer | None = None
        self._arrived: deque[bytes] = deque()
        self._change = threading.Condition()
        self._worked_on = False
        self._receiver: int | None = None
        self.uri = ""

    def connect(
        self,
        uri: str,
        radio_link_statistics_callback: Callable[[Any], None] | None,
        link_error_callback: Callable[[str], None] | None,
    ) -> None:
        """Open ``perchhw://NAME``.

        Raises:
            WrongUriType: another scheme.
            LinkInputError: nobody serves this name.
        """
        if not uri.startswith(SCHEME):
            raise WrongUriType(f"not {SCHEME}")
        server = _served.get(uri.removeprefix(SCHEME))
        if server is None:
            known = ", ".join(_served) or "none"
            raise LinkInputError(f"{uri}: no lab in this process serves it; served: {known}")
        self.uri, self._server = uri, server
        server.client_came(self)

    def send_packet(self, pk: CRTPPacket) -> None:
        """Hand one packet to the drone; what it answers at once has then arrived."""
        if self._server is not None:
            self._server.take(bytes((pk.header, *pk.data)))

    def receive_packet(self, wait: float = 0) -> CRTPPacket | None:
        """The next packet, waited for at most `wait` s; for ever when that is negative."""
        with self._change:
            self._receiver = threading.get_ident()
            self._worked_on = False
            self._change.notify_all()
            self._change.wait_for(
                lambda: bool(self._arrived) or self._server is None, None if wait < 0 else wait
            )
            if not self._arrived:
                return None
            self._worked_on = True
            data = self._arrived.popleft()
        return CRTPPacket(data[0], data[1:])

    def deliver(self, datagram: bytes) -> None:
        """A packet for the client."""
        with self._change:
            self._arrived.append(datagram)
            self._change.notify_all()

    def settled(self, timeout_s: float) -> bool:
        """Wait until the client has worked off all that was delivered; False: it has not within `timeout_s`.
        Asked by the receiving thread itself it is at once."""
        if threading.get_ident() == self._receiver:
            return True
        with self._change:
            return self._change.wait_for(self._is_settled, timeout_s)

    def _is_settled(self) -> bool:
        return self._server is None or not (self._arrived or self._worked_on)

    def close(self) -> None:
        """Close the link."""
        with self._change:
            server, self._server = self._server, None
            self._change.notify_all()
        if server is not None:
            server.client_left(self)

    def get_status(self) -> str:
        """For cflib."""
        return "No information available"

    def get_name(self) -> str:
        """For cflib."""
        return "perchhw"

    def scan_interface(self, address: int | None = None) -> list[list[str]]:
        """All that are served."""
        return [[SCHEME + name, ""] for name in _served]
