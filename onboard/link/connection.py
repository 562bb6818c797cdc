"""Connecting: who is there, what it has, and no more than that.

In this order: link source and protocol version; then, at once, a reset of the log blocks that somebody left
behind, size and checksum of the two tables and the number of memories; then the details of the memories; then
the rows of tables that were never read before. cflib asks for these one after the other, and then for the
value of every parameter: 1450 round trips instead of 5, or of 230 the first time. Layouts, little endian:

- port 15, channel 1: ``00`` -> ``Bitcraze Crazyflie``, padded.
- port 13, channel 1: ``00`` -> ``00 version``.
- port 2 or 5, channel 0: ``03`` -> ``03 rows u16 checksum u32``; ``02 id u16`` -> ``02 id type group 00
  name 00``.
- port 4, channel 0: ``01`` -> ``01 count``; ``02 id`` -> ``02 id type u8 size u32 address 8 bytes``. An id
  that does not exist restarts the drone (``mem.c``): none is asked for.
- port 5, channel 1: ``05`` -> ``05 00 00``.
"""

import struct
import threading
from dataclasses import dataclass

from cflib.crtp.crtpstack import CRTPPort

from onboard.link.crazyflie import BareCrazyflie, broken_opening, closed_on_error, late_opening
from onboard.link.deadline import GrowingDeadline
from onboard.link.driver import install_driver, links_live_in
from onboard.link.errors import LinkError, LinkLost, LinkTimeout
from onboard.link.exchange import Exchange, Query
from onboard.link.exclusive import hold
from onboard.link.memory import MemoryInfo
from onboard.link.table_cache import Rows, TableCache
from onboard.link.uri import check_drone_uri
from onboard.link.variables import DroneVariable, log_table, parameter_table
from onboard.timebase import WALL, Timebase

#: First CRTP protocol version with the supervisor port (firmware 2025.12).
PROTOCOL_VERSION_MIN = 12
_MAGIC = b"Bitcraze Crazyflie"
_TABLE, _SETTINGS, _VERSION, _SOURCE = 0, 1, 1, 1
_ROW, _INFO = 2, 3
_COUNT, _DETAILS = 1, 2
_LOG_RESET = 5


@dataclass(frozen=True, slots=True)
class Contents:
    """What a drone says that it has: parameters and log variables by complete name, and memories."""

    parameters: dict[str, DroneVariable]
    logs: dict[str, DroneVariable]
    memories: list[MemoryInfo]


@dataclass(frozen=True, slots=True)
class Connection:
    """An open link, requests on it, and what the drone has."""

    crazyflie: BareCrazyflie
    exchange: Exchange
    contents: Contents


def connect(uri: str, *, timeout_s: float, clock: Timebase, tables: TableCache) -> Connection:
    """Open a link and read what the drone has.

    Args:
        uri: ``udp://``, ``radio://`` or ``usb://`` address.
        timeout_s: deadline in real time [s]; later when answers are measured to take long.
        clock: the time that the link goes by.
        tables: where tables that were read before are kept.

    Raises:
        LinkInputError: the URI cannot be used.
        DroneInUse: another process talks to the drone.
        LinkError: nobody is there, no driver or radio for this URI, or firmware that is too old.
        LinkTimeout: not connected by the deadline.
        LinkLost: the drone answered and then vanished.
    """
    check_drone_uri(uri)
    install_driver()
    crazyflie = BareCrazyflie(hold(uri))
    with closed_on_error(crazyflie, uri):
        exchange = Exchange(crazyflie, uri, clock)
        deadline = GrowingDeadline(WALL(), clock.patience(timeout_s))
        with clock.connecting(), links_live_in(uri, clock):
            _open(crazyflie, uri, exchange, deadline)
            contents = _Inquiry(crazyflie, uri, exchange, deadline, tables).contents()
        return Connection(crazyflie, exchange, contents)


def _open(crazyflie: BareCrazyflie, uri: str, exchange: Exchange, deadline: GrowingDeadline) -> None:
    """Let cflib find the driver."""
    refusals: list[str] = []
    over = threading.Event()

    def refused(_uri: str, message: str) -> None:
        refusals.append(message)
        exchange.fail(message)
        over.set()

    crazyflie.connection_failed.add_callback(refused)
    crazyflie.connection_lost.add_callback(refused)
    crazyflie.open_beside(uri)
    while not (crazyflie.opened.is_set() or over.is_set()):
        if WALL() >= deadline.at:
            raise late_opening(uri, deadline.at - deadline.began, heard=False)
        crazyflie.opened.wait(0.01)
    if refusals:
        raise broken_opening(uri, refusals[0], heard=False)


class _Inquiry:
    """Asks what there is to know, in the machine's time: in a lab's, connecting takes none."""

    def __init__(
        self,
        crazyflie: BareCrazyflie,
        uri: str,
        exchange: Exchange,
        deadline: GrowingDeadline,
        tables: TableCache,
    ) -> None:
        self._crazyflie = crazyflie
        self._uri = uri
        self._exchange = exchange
        self._deadline = deadline
        self._tables = tables

    def contents(self) -> Contents:
        """All of it."""
        self._refuse_strangers()
        _, logs, parameters, memories = self._ask(
            Query(CRTPPort.LOGGING, _SETTINGS, bytes((_LOG_RESET,)), 1, 1),
            Query(CRTPPort.LOGGING, _TABLE, bytes((_INFO,)), 1, 7),
            Query(CRTPPort.PARAM, _TABLE, bytes((_INFO,)), 1, 7),
            Query(CRTPPort.MEM, _TABLE, bytes((_COUNT,)), 1, 2),
        )
        return Contents(
            parameter_table(self._rows("parameters", CRTPPort.PARAM, parameters)),
            log_table(self._rows("logs", CRTPPort.LOGGING, logs)),
            self._memories(memories[1]),
        )

    def _refuse_strangers(self) -> None:
        source, version = self._ask(
            Query(CRTPPort.LINKCTRL, _SOURCE, b"\0", 0, 1),
            Query(CRTPPort.PLATFORM, _VERSION, b"\0", 1, 2),
        )
        if not source.startswith(_MAGIC):
            raise LinkError(f"what answers at {self._uri} is no Crazyflie; is this the drone's address?")
        if version[1] < PROTOCOL_VERSION_MIN:
            raise LinkError(
                f"the firmware of {self._uri} has protocol {version[1]}, needed is {PROTOCOL_VERSION_MIN}; "
                "update it"
            )

    def _rows(self, kind: str, port: int, info: bytes) -> Rows:
        length, checksum = struct.unpack_from("<HI", info, 1)
        rows = self._tables.fetch(kind, checksum, length)
        if rows is None:
            asked = (bytes((_ROW,)) + struct.pack("<H", ident) for ident in range(length))
            answers = self._ask(*(Query(port, _TABLE, payload, 3, 6) for payload in asked))
            rows = [_row(answer) for answer in answers]
            self._tables.keep(kind, checksum, rows)
        return rows

    def _memories(self, count: int) -> list[MemoryInfo]:
        asked = (bytes((_DETAILS, ident)) for ident in range(count))
        answers = self._ask(*(Query(CRTPPort.MEM, _TABLE, payload, 2, 7) for payload in asked))
        return [MemoryInfo(*struct.unpack_from("<BBI", answer, 1)) for answer in answers]

    def _ask(self, *questions: Query) -> list[bytes]:
        """Ask in real time.

        Raises:
            LinkError: no answer, as somebody who connects wants to read it.
        """
        heard = self._crazyflie.heard
        try:
            return self._exchange.ask_all(questions, time=WALL, deadline=self._deadline, what="connecting")
        except LinkTimeout as error:
            raise late_opening(self._uri, WALL() - self._deadline.began, heard.is_set()) from error
        except LinkLost as error:
            reason = self._crazyflie.failure or str(error)
            raise broken_opening(self._uri, reason, heard.is_set()) from error


def _row(answer: bytes) -> tuple[int, str]:
    group, name, *_ = answer[4:].decode("latin-1").split("\0")
    return answer[3], f"{group}.{name}"
