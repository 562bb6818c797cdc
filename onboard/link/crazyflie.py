"""Opening and closing cflib's ``Crazyflie`` with deadlines, guarding the two places where it can lock itself
up, and keeping it from ending the flight of somebody else."""

import logging
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from cflib.crazyflie import Crazyflie
from cflib.crtp.crtpstack import CRTPPort

from onboard.link.driver import install_driver, links_live_in
from onboard.link.errors import BROKE_WHILE_SET_UP, LinkError, LinkLost, LinkTimeout
from onboard.link.exclusive import DroneHold, hold
from onboard.link.uri import check_drone_uri
from onboard.timebase import Timebase

_CLOSE_DEADLINE = 2.0
_FLYING_PORTS = frozenset({CRTPPort.COMMANDER, CRTPPort.COMMANDER_GENERIC, CRTPPort.SETPOINT_HL})
_ARM_SUPERVISOR, _ARM_PLATFORM = (CRTPPort.SUPERVISOR, 1), (CRTPPort.PLATFORM, 0)
_ARM = 1
_NOT_OPENED = "Couldn't load link driver: "
"""How cflib begins what it says of a driver that cannot open, to its log with a traceback, and to us."""
_log = logging.getLogger(__name__)


def _is_no_refusal(record: logging.LogRecord) -> bool:
    """A refusal is raised as an error of ours: nobody needs it twice."""
    return not record.getMessage().startswith(_NOT_OPENED)


logging.getLogger("cflib.crazyflie").addFilter(_is_no_refusal)


class _TablesSeen:
    """Keeps the tables of contents that this process has seen, by their checksum: campaigns connect often."""

    def __init__(self) -> None:
        self._tables: dict[int, object] = {}

    def fetch(self, crc: int) -> object | None:
        """The table with this checksum, or None."""
        return self._tables.get(crc)

    def insert(self, crc: int, toc: object) -> None:
        """Keep a table that was downloaded."""
        self._tables[crc] = toc


_tables_seen = _TablesSeen()


def takes_over(pk: Any) -> bool:
    """Whether a packet arms the motors or commands the flight (either way of arming that firmware knows)."""
    return pk.port in _FLYING_PORTS or (
        (pk.port, pk.channel) in (_ARM_SUPERVISOR, _ARM_PLATFORM)
        and len(pk.data) > 1
        and pk.data[0] == _ARM
        and pk.data[1] != 0
    )


class GuardedCrazyflie(Crazyflie):
    """cflib's ``Crazyflie``, for which a link error can never end in a deadlock, whatever the driver.

    In cflib 0.1.34 ``send_packet`` reads the link twice and keeps its lock when anything below it raises; and
    a driver that reports an error from inside a send (the radio does, when its queue is full) makes cflib
    wait for a thread that waits for this very lock.

    cflib also sends a zero setpoint whenever it closes, which takes a flying drone out of the air. Here it
    does so only when this very link has armed or commanded the drone.

    Args:
        held: the lock of the drone, released when the link is closed.
    """

    def __init__(self, held: DroneHold) -> None:
        self._held = held
        self._took_over = False
        self._keeps_quiet = False
        self._opening: threading.Thread | None = None
        self.failure: str | None = None
        self.ended = threading.Event()  # it failed, or is being closed
        self.heard = threading.Event()
        self._failure_lock = threading.Lock()
        self._failure_thread: threading.Thread | None = None
        self._closing = False
        super().__init__()
        self._toc_cache = _tables_seen
        self.packet_received.add_callback(lambda _packet: self.heard.set())

    def send_packet(
        self, pk: Any, expected_reply: tuple[int, ...] = (), resend: bool = False, timeout: float = 0.2
    ) -> None:
        """As cflib's; without its lock and timers where the driver resends by itself or need not."""
        link = self.link
        if link is None or (self._keeps_quiet and pk.port == CRTPPort.COMMANDER):
            return
        if link.needs_resending:
            self._note(pk)
            super().send_packet(pk, expected_reply, resend, timeout)
        else:
            self.transmit(pk)
            self.packet_sent.call(pk)

    def transmit(self, pk: Any) -> None:
        """Hand a packet to the driver, past cflib."""
        link = self.link
        if link is not None:
            self._note(pk)
            link.send_packet(pk)

    def _note(self, pk: Any) -> None:
        """Threads only ever set it, before the packet leaves: so none can lose what another has noted."""
        if takes_over(pk):
            self._took_over = True

    def close_link(self) -> None:
        """As cflib's; a drone that this link has neither armed nor commanded gets no zero setpoint."""
        self._keeps_quiet = not self._took_over
        try:
            super().close_link()
        finally:
            self._keeps_quiet = False

    def _link_error_cb(self, errmsg: str) -> None:
        """Note the error at once; let cflib take the connection down on a thread of its own, one time."""
        with self._failure_lock:
            if self.failure is not None or self._closing:
                return
            self.failure = errmsg
            self._failure_thread = threading.Thread(
                target=super()._link_error_cb, args=(errmsg,), name="LinkDown", daemon=True
            )
            self._failure_thread.start()
        self.ended.set()

    def open_beside(self, uri: str) -> None:
        """Begin to open the link, on a thread: looking for a radio can take its time."""
        self._opening = threading.Thread(target=self.open_link, args=(uri,), name="LinkOpen", daemon=True)
        self._opening.start()

    def close_within(self, seconds: float) -> bool:
        """Close the link, which cuts motors that it commanded; False if cflib did not manage in time (its
        thread is left behind, and keeps other processes off the drone)."""
        self.ended.set()
        closing = threading.Thread(target=self._close, name="LinkClose", daemon=True)
        closing.start()
        closing.join(seconds)
        return not closing.is_alive()

    def _close(self) -> None:
        with self._failure_lock:
            self._closing = True
            failure_thread = self._failure_thread
        for thread in (self._opening, failure_thread):
            if thread is not None:
                thread.join()
        try:
            self.close_link()
        finally:
            self._held.release()


class BareCrazyflie(GuardedCrazyflie):
    """One that only carries packets: nothing of cflib asks the drone anything, nor takes its answers.

    Attributes:
        opened: the driver is connected.
    """

    def __init__(self, held: DroneHold) -> None:
        super().__init__(held)
        self.opened = threading.Event()
        self.connection_requested.remove_callback(self.param._connection_requested)
        self.incoming.cb.clear()

    def _start_connection_setup(self) -> None:
        self.opened.set()


@contextmanager
def closed_on_error(crazyflie: GuardedCrazyflie, uri: str) -> Iterator[None]:
    """Close the link when what follows fails."""
    try:
        yield
    except BaseException:
        if not crazyflie.close_within(_CLOSE_DEADLINE):
            _log.warning(
                "cflib did not close %s within %g s; its threads stay until the process ends",
                uri,
                _CLOSE_DEADLINE,
            )
        raise


def open_crazyflie(uri: str, *, timeout_s: float, clock: Timebase) -> GuardedCrazyflie:
    """Connect as cflib does, completely: link, tables of contents, memories, and the value of every
    parameter. For clients of cflib; :class:`onboard.link.DroneLink` needs less.

    Args:
        uri: ``udp://``, ``radio://`` or ``usb://`` address.
        timeout_s: deadline for all of it, in real time [s].
        clock: the time that the link goes by.

    Raises:
        LinkInputError: the URI cannot be used.
        DroneInUse: another process talks to the drone.
        LinkError: nobody is there, or no driver or radio for this URI.
        LinkTimeout: not connected by the deadline.
        LinkLost: the drone answered and then vanished.
    """
    check_drone_uri(uri)
    install_driver()
    crazyflie = GuardedCrazyflie(hold(uri))
    with closed_on_error(crazyflie, uri):
        _connect(crazyflie, uri, timeout_s, clock)
    return crazyflie


def _connect(crazyflie: GuardedCrazyflie, uri: str, timeout_s: float, clock: Timebase) -> None:
    finished = threading.Event()
    refusals: list[str] = []

    def refused(_uri: str, message: str) -> None:
        refusals.append(message)
        finished.set()

    crazyflie.fully_connected.add_callback(lambda _uri: finished.set())
    crazyflie.connection_failed.add_callback(refused)
    crazyflie.connection_lost.add_callback(refused)
    with clock.connecting(), links_live_in(uri, clock):
        crazyflie.open_beside(uri)
        connected = finished.wait(clock.patience(timeout_s))
    heard = crazyflie.heard.is_set()
    if refusals:
        raise broken_opening(uri, refusals[0], heard)
    if not connected:
        raise late_opening(uri, timeout_s, heard)


def broken_opening(uri: str, message: str, heard: bool) -> LinkError:
    """The error for a link that cflib could not open, or that failed at once, with its message."""
    refusal = message.strip().splitlines()[0]
    if heard:
        return LinkLost(f"{uri} answered, but {BROKE_WHILE_SET_UP}: {refusal}")
    if refusal.startswith(_NOT_OPENED) and uri.startswith("radio://"):
        reason = refusal.removeprefix(_NOT_OPENED)
        return LinkError(f"cannot open {uri}: {reason}; is a Crazyradio plugged in, and free?")
    return LinkError(f"no drone at {uri}: {refusal}. Is it on, and are address and port right?")


def late_opening(uri: str, seconds: float, heard: bool) -> LinkTimeout:
    """The error for a drone that has not answered everything by the deadline."""
    if heard:
        return LinkTimeout(
            f"{uri} answers, but is not fully connected after {seconds:.3g} s; the link is slow or lossy. "
            "More patience: ?connect_s=SECONDS behind the address"
        )
    return LinkTimeout(
        f"{uri} did not answer within {seconds:.3g} s; is the drone on, and is this its address?"
    )
