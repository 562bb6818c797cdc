"""Opening and closing cflib's ``Crazyflie`` with deadlines, guarding the two places where it can lock itself
up, and keeping it from ending the flight of somebody else."""

import logging
import threading
from pathlib import Path
from typing import Any

from cflib.crazyflie import Crazyflie
from cflib.crtp.crtpstack import CRTPPort

from onboard.link.driver import install_driver, links_live_in
from onboard.link.errors import LinkError, LinkLost, LinkTimeout
from onboard.link.exclusive import Hold, hold
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
        toc_cache: as for :func:`open_crazyflie`.
    """

    def __init__(self, held: Hold, toc_cache: Path | None = None) -> None:
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
        super().__init__(rw_cache=None if toc_cache is None else str(toc_cache))
        if toc_cache is None:
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


def open_crazyflie(
    uri: str, *, timeout_s: float, clock: Timebase, toc_cache: Path | None = None
) -> GuardedCrazyflie:
    """Connect completely: link, tables of contents, memories, and the value of every parameter.

    Args:
        uri: ``udp://``, ``radio://`` or ``usb://`` address.
        timeout_s: deadline for all of it, in real time [s].
        clock: the time that the link goes by.
        toc_cache: folder for tables of contents that were seen before. Only one that this user alone can
            write to: cflib evaluates names in these files.

    Raises:
        LinkInputError: the URI cannot be used.
        DroneInUse: another process talks to the drone.
        LinkError: nobody is there, or no driver or radio for this URI.
        LinkTimeout: not connected by the deadline.
        LinkLost: the drone answered and then vanished.
    """
    check_drone_uri(uri)
    install_driver()
    crazyflie = GuardedCrazyflie(hold(uri), toc_cache)
    try:
        _connect(crazyflie, uri, timeout_s, clock)
    except BaseException:
        if not crazyflie.close_within(_CLOSE_DEADLINE):
            _log.warning(
                "cflib did not close %s within %g s; its threads stay until the process ends",
                uri,
                _CLOSE_DEADLINE,
            )
        raise
    return crazyflie


def _connect(crazyflie: GuardedCrazyflie, uri: str, timeout_s: float, clock: Timebase) -> None:
    finished = threading.Event()
    refusals: list[str] = []

    def on_connection_failed(_uri: str, message: str) -> None:
        refusals.append(message.strip().splitlines()[0])
        finished.set()

    def on_connection_lost(_uri: str, message: str) -> None:
        on_connection_failed(_uri, message)

    crazyflie.fully_connected.add_callback(lambda _uri: finished.set())
    crazyflie.connection_failed.add_callback(on_connection_failed)
    crazyflie.connection_lost.add_callback(on_connection_lost)
    with clock.connecting(), links_live_in(uri, clock):
        crazyflie.open_beside(uri)
        connected = finished.wait(clock.patience(timeout_s))
    if refusals or not connected:
        raise _opening_error(uri, timeout_s, refusals, crazyflie.heard.is_set())


def _opening_error(uri: str, timeout_s: float, refusals: list[str], heard: bool) -> LinkError:
    if refusals and heard:
        return LinkLost(f"{uri} answered, but the connection broke while it was set up: {refusals[0]}")
    if refusals and refusals[0].startswith(_NOT_OPENED) and uri.startswith("radio://"):
        reason = refusals[0].removeprefix(_NOT_OPENED)
        return LinkError(f"cannot open {uri}: {reason}; is a Crazyradio plugged in, and free?")
    if refusals:
        return LinkError(f"no drone at {uri}: {refusals[0]}. Is it on, and are address and port right?")
    if heard:
        return LinkTimeout(
            f"{uri} answers, but is not fully connected after {timeout_s:g} s; the link is slow or lossy"
        )
    return LinkTimeout(
        f"{uri} did not answer within {timeout_s:g} s; is the drone on, and is this its address?"
    )
