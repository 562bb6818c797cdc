"""A CRTP driver for ``udp://`` under cflib that resends, de-duplicates, watches for silence and never hangs.

One UDP datagram is one CRTP packet: a header byte and up to 30 bytes of payload, no checksum, no handshake.
cflib's own driver for this scheme sends every request once and reports a vanished peer from inside
``send_packet``, while cflib holds a lock that the report needs. This one differs in five ways:

1. *Resending.* It repeats every request that demands an answer (also the two that cflib never repeats: link
   source and protocol version), at a pace measured from the round trips. cflib's timers stay out of it
   (``needs_resending`` is False): one thread a request, and on a late timer the same packet once more after
   its answer.
2. *De-duplication.* A reply passes only while its request is outstanding, see :mod:`onboard.link.replies`.
3. *Watchdog.* Silence for ``silence_s`` although answers were asked for (cflib pings ten times a second) is a
   link error.
4. *Errors* reach cflib once, from a thread of their own, never from inside a send or a receive.
5. *Bounds.* The receive queue has a limit (what does not fit is dropped as if the network had lost it), sends
   never block, and closing takes some ten milliseconds.

Resending, the watchdog and the queue go by the time that :func:`links_live_in` gives, so that a simulated lab
that keeps its own time loses nothing to a busy machine.

URI: ``udp://HOST:PORT[?silence_s=SECONDS]``; other query keys are ignored, as cflib itself appends some.
"""

import contextlib
import queue
import socket
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace

import cflib.crtp
from cflib.crtp.crtpdriver import CRTPDriver
from cflib.crtp.crtpstack import CRTPPacket
from cflib.crtp.exceptions import WrongUriType
from cflib.crtp.radiodriver import RadioDriver
from cflib.crtp.udpdriver import UdpDriver

from onboard.link.errors import LinkError
from onboard.link.radio import GuardedRadioDriver
from onboard.link.replies import ECHO_HEADER, PORT_AND_CHANNEL, CrtpPacket, OutstandingRequests
from onboard.link.stop_ports import UdpStopPort
from onboard.link.uri import UdpAddress, parse_udp_uri
from onboard.timebase import WALL, Queue, Timebase, Transport

#: Packets kept for a client that does not take them: 2 s of 16 log blocks at 100 Hz.
QUEUE_LIMIT = 4096
DATAGRAM_MAX = 31
_TICK = 0.01
_RECEIVE_BUFFER = 1 << 20

_install_lock = threading.Lock()
_times: dict[str, Timebase] = {}
_for_everybody = False


@dataclass(slots=True)
class DriverStatistics:
    """Packet counts since the link was opened."""

    sent: int = 0
    resent: int = 0
    received: int = 0
    duplicates: int = 0
    overflow: int = 0


def install_driver(for_everybody: bool = False) -> None:
    """Make cflib use :class:`ResendingUdpDriver` for ``udp://`` and :class:`GuardedRadioDriver` for
    ``radio://``; other schemes keep cflib's. Idempotent.

    ``udp://`` links that our own code does not open stay with cflib's driver unless it is `for_everybody`:
    cflib's ``SyncCrazyflie.open_link`` waits for ever for a link that is reported lost while it is set up,
    which cflib's driver never does.
    """
    global _for_everybody
    with _install_lock:
        _for_everybody = _for_everybody or for_everybody
        classes = cflib.crtp.CLASSES
        if UdpDriver not in classes:
            cflib.crtp.init_drivers()
        if ResendingUdpDriver not in classes:
            classes.insert(classes.index(UdpDriver), ResendingUdpDriver)
            if RadioDriver in classes:  # not when cflib was told to use its C++ link
                classes[classes.index(RadioDriver)] = GuardedRadioDriver


@contextmanager
def links_live_in(uri: str, time: Timebase) -> Iterator[None]:
    """Links to `uri` that cflib opens meanwhile, by URI alone, are ours and go by `time`."""
    _times[uri] = time
    try:
        yield
    finally:
        _times.pop(uri, None)


class ResendingUdpDriver(CRTPDriver):
    """CRTP over UDP for a network that may lose, double, delay and reorder. See the module's description."""

    def __init__(self) -> None:
        super().__init__()
        self.needs_resending = False
        self.uri = ""
        self.statistics_so_far = DriverStatistics()
        self._address: UdpAddress | None = None
        self._socket: socket.socket | None = None
        self._on_error: Callable[[str], None] | None = None
        self._time: Timebase = WALL
        self._incoming: Queue = WALL.queue(QUEUE_LIMIT)
        self._transport: Transport = WALL.transport("")
        self._request_noted = WALL.event()
        # Guards everything below and the counts; held for microseconds, never while sending or calling out.
        self._lock = threading.Lock()
        self._requests = OutstandingRequests()
        self._unanswered_since: float | None = None
        self._failed = False
        self._closed = threading.Event()
        self._threads: tuple[threading.Thread, ...] = ()
        self._reader: threading.Thread | None = None
        self._stop_port: UdpStopPort | None = None

    def connect(
        self,
        uri: str,
        radio_link_statistics_callback: Callable[..., None] | None,
        link_error_callback: Callable[[str], None] | None,
    ) -> None:
        """Open the socket and start receiving; sends nothing.

        Raises:
            WrongUriType: not a ``udp://`` URI, or a link of somebody else (cflib then tries its next driver).
            LinkInputError: the URI is malformed.
            LinkError: the host name does not resolve.
        """
        if not uri.startswith("udp://"):
            raise WrongUriType("not a udp:// URI")
        if not (_for_everybody or uri in _times):
            raise WrongUriType("opened by cflib's user, who is not asked to take this driver")
        address = parse_udp_uri(uri)
        udp = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        try:
            udp.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, _RECEIVE_BUFFER)
            udp.connect((address.host, address.port))
        except OSError as error:
            udp.close()
            raise LinkError(f"cannot reach {uri}: {error}; check host and network") from error
        udp.settimeout(_TICK)
        self.uri, self._address, self._socket, self._on_error = uri, address, udp, link_error_callback
        self._time = time = _times.get(uri, WALL)
        self._incoming, self._request_noted = time.queue(QUEUE_LIMIT), time.event()
        self._transport = time.transport(f"udp:{udp.getsockname()[1]}")
        self._threads = (
            time.thread(self._receive_loop, "UdpLink"),
            time.thread(self._resend_loop, "UdpLinkResend"),
        )

    def send_packet(self, pk: CrtpPacket) -> bool:
        """Send without blocking; False if the packet did not leave. Link errors come on a thread."""
        udp, now = self._socket, self._time()
        if udp is None or self._failed:
            return False
        with self._lock:
            wants_answer = self._requests.sending(pk, now) or pk.header & PORT_AND_CHANNEL == ECHO_HEADER
            if wants_answer and self._unanswered_since is None:
                self._unanswered_since = now
            self.statistics_so_far.sent += 1
        sent = self._transmit(udp, pk)
        if wants_answer:
            self._request_noted.set()
        return sent

    def receive_packet(self, wait: float = 0) -> CRTPPacket | None:
        """The next packet, or None after ``wait`` s (0: at once; negative: until the link closes)."""
        if self._closed.is_set():
            # cflib polls a link that it is just closing; without a pause it can catch itself half-closed.
            self._time.foreign()
            threading.Event().wait(2 * _TICK)
            return None
        self._reader = threading.current_thread()
        packet: CRTPPacket | None = None
        with contextlib.suppress(queue.Empty):
            packet = (
                self._incoming.get_nowait()
                if wait == 0
                else self._incoming.get(timeout=None if wait < 0 else wait)
            )
        if self._closed.is_set():
            self._time.foreign()
        return packet

    def close(self) -> None:
        """Close the socket and end the thread; no error is reported any more. Sends nothing."""
        with self._lock:
            self._closed.set()
            udp, self._socket = self._socket, None
            self._on_error = None
        self._request_noted.set()
        for thread in self._threads:
            if thread is not threading.current_thread():
                thread.join(timeout=1.0)
        if udp is not None:
            udp.close()
        self._transport.close()
        with contextlib.suppress(queue.Full):
            self._incoming.put_nowait(None)  # ends a receive_packet that is waiting
        if self._reader not in (None, threading.current_thread()):
            self._time.foreign(self._reader)  # cflib's; it polls for a next link in real time

    def stop_port(self) -> UdpStopPort:
        """A way out for an emergency stop, which outlives this driver.

        Raises:
            LinkError: the link is closed.
        """
        udp = self._socket
        if udp is None:
            raise LinkError(f"the link to {self.uri} is closed: it carries no stop")

        def read_here() -> bool:
            return not (self._failed or self._closed.is_set())

        self._stop_port = UdpStopPort(udp, read_here, self._transport.sent)
        return self._stop_port

    def statistics(self) -> DriverStatistics:
        """A copy of the packet counts."""
        with self._lock:
            return replace(self.statistics_so_far)

    def get_name(self) -> str:
        """The scheme's name, as cflib wants it."""
        return "udp"

    def get_status(self) -> str:
        """One line about the driver, as cflib wants it."""
        return "perchhw udp driver"

    def scan_interface(self, address: int | None = None) -> list[list[str]]:
        """Nothing: cflib's own UDP driver, which stays installed, does the scanning."""
        return []

    def _transmit(self, udp: socket.socket, packet: CrtpPacket) -> bool:
        try:
            udp.send(bytes((packet.header,)) + packet.data)
        except (BlockingIOError, TimeoutError, InterruptedError):
            return False  # as if the network had lost it
        except OSError as error:
            self._fail(f"cannot send to {self.uri}: {error.strerror or error}")
            return False
        self._transport.sent(1)
        return True

    def _receive_loop(self) -> None:
        udp = self._socket
        while udp is not None and not self._closed.is_set() and not self._failed:
            try:
                with self._transport.blocking():
                    datagram = udp.recv(DATAGRAM_MAX + 1)
            except TimeoutError:
                # Only when nothing waits to be read: a process that was paused first reads what came
                # meanwhile.
                self._check_silence()
            except OSError as error:
                self._fail(f"cannot receive from {self.uri}: {error.strerror or error}")
            else:
                self._take(datagram)
                self._transport.received(1)

    def _take(self, datagram: bytes) -> None:
        if self._stop_port is not None:
            self._stop_port.take(datagram)
        if not 1 <= len(datagram) <= DATAGRAM_MAX:
            return
        with self._lock:
            self.statistics_so_far.received += 1
            self._unanswered_since = None
            if self._incoming.qsize() >= QUEUE_LIMIT:
                # Before the reply is matched, as if the packet never came: it will be asked for again.
                self.statistics_so_far.overflow += 1
                return
            if not self._requests.accept(datagram, self._time()):
                self.statistics_so_far.duplicates += 1
                return
        self._incoming.put_nowait(CRTPPacket(datagram[0], datagram[1:]))

    def _resend_loop(self) -> None:
        """Send again what was not answered; sleeps while nothing is outstanding."""
        while not self._closed.is_set() and not self._failed:
            with self._lock:
                packets = self._requests.due(self._time())
                due = self._requests.next_due()
                self.statistics_so_far.resent += len(packets)
                udp = self._socket
            for packet in packets:
                if udp is not None:
                    self._transmit(udp, packet)
            self._request_noted.wait(None if due is None else due - self._time())
            self._request_noted.clear()

    def _check_silence(self) -> None:
        address, since = self._address, self._unanswered_since
        # A peer that never said anything is not lost but absent: the opening's deadline deals with it.
        if address is None or since is None or self.statistics_so_far.received == 0:
            return
        silence = self._time() - since
        if silence > address.silence_s:
            self._fail(f"no packet from {self.uri} for {silence:.2f} s although asked: frozen or away")

    def _fail(self, message: str) -> None:
        with self._lock:
            callback = self._on_error
            if self._failed or self._closed.is_set():
                return
            self._failed = True
        self._transport.close()  # nobody reads any more: a lab must not wait for it
        self._request_noted.set()
        if callback is not None:
            threading.Thread(target=callback, args=(message,), name="UdpLinkError", daemon=True).start()
