"""A device that speaks the line protocol: handshake, reader thread, marks, counts."""

import re
import threading
from collections import Counter
from dataclasses import dataclass

from calibration.bench.instruments.continuity import Continuity, Placed
from calibration.bench.instruments.diagnosis import no_banner
from calibration.bench.instruments.errors import (
    InstrumentError,
    InstrumentInputError,
    InstrumentLost,
    InstrumentTimeout,
    WrongDevice,
)
from calibration.bench.instruments.mailbox import Mailbox
from calibration.bench.instruments.protocol import Banner, EventLine, Fault, Kind, LineParser, MarkLine
from calibration.bench.instruments.reader import PortReader, Reconnect
from calibration.bench.instruments.transport import IO_TIMEOUT_S, Address, SerialPort
from onboard.clock import Clock, monotonic
from onboard.closing import Closing

BAUD = 115_200
#: A board of the Uno class resets when its port opens and is silent for up to 2.5 s.
HANDSHAKE_S = 5.0
_ASK_EVERY_S = 0.3
#: Ten missed heartbeats: the link is dead, whatever the motor does [s].
SILENCE_MAX_S = 1.0
#: Lines kept for a slow user: several minutes at full speed.
_LINES_MAX = 40_000
_TAG = re.compile(r"[A-Za-z0-9_.-]{1,16}")


@dataclass(frozen=True, slots=True)
class LinkReport:
    """What the link has lost so far.

    Attributes:
        faults: lines thrown away, by reason.
        lost: lines missing by their sequence numbers (the thrown away ones among them).
        misplaced: lines with a correct checksum that fit nowhere.
        restarts: times that the device began anew.
        wraps: times that its clock wrapped.
        reopened: times that it was unplugged and came back.
        refused: lines that found this program's buffer full.
        events: what the device reported itself, in order.
    """

    faults: dict[Fault, int]
    lost: int
    misplaced: int
    restarts: int
    wraps: int
    reopened: int
    refused: int
    events: tuple[EventLine, ...]

    @property
    def clean(self) -> bool:
        """Whether nothing at all went wrong."""
        counts = (self.lost, self.misplaced, self.restarts, self.reopened, self.refused)
        return not any(counts) and not any(self.faults.values()) and not self.events


class LineDevice(Closing):
    """An open tachometer or load cell, as lines in their places. A context manager.

    Attributes:
        banner: who it is; the newest one.
        patience: how many times a second it may be silent; more than 1 for one that is simulated on a busy
            machine (:attr:`onboard.link.DroneLink.patience`).
    """

    def __init__(
        self,
        address: str,
        kind: Kind,
        *,
        clock: Clock = monotonic,
        reconnect: Reconnect | None = None,
        handshake_s: float = HANDSHAKE_S,
    ) -> None:
        """Open the port and wait until the device has said who it is.

        Args:
            address: ``serial:///dev/...?baud=N`` or a device path.
            kind: what must be there.
            clock: host clock for the stamps of receipt [s].
            reconnect: see :data:`~calibration.bench.instruments.reader.Reconnect`.
            handshake_s: deadline for the banner [s].

        Raises:
            InstrumentInputError, InstrumentNotFound: the port cannot be used.
            WrongBaudRate, WrongDevice, InstrumentTimeout: it is not the device that was asked for.
            InstrumentLost: unplugged meanwhile.
        """
        port = SerialPort(Address.parse(address, BAUD))
        self._clock = clock
        self._parser = LineParser()
        try:
            self.banner = _handshake(port, self._parser, clock, handshake_s)
            if self.banner.kind is not kind:
                raise WrongDevice(_kind_text(port.address.device, self.banner, kind))
        except InstrumentError:
            port.close()
            raise
        self.patience = 1.0
        self._answer_s = port.address.answer_s
        self._continuity = Continuity()
        self._box: Mailbox[Placed] = Mailbox(_LINES_MAX)
        self._marks: dict[str, Placed] = {}
        self._marked = threading.Condition()
        self._events: list[EventLine] = []
        self._started = False
        self._epoch = 0
        self._heard = clock()
        self._faults_before = Counter(self._parser.faults)
        self._reader = PortReader(
            port, self._on_bytes, self._on_reopened, self._box.fail, clock=clock, reconnect=reconnect
        )
        self._reader.start()

    @property
    def device(self) -> str:
        """Name of its port now."""
        return self._reader.device

    @property
    def report(self) -> LinkReport:
        """What the link has lost since the handshake."""
        continuity = self._continuity
        return LinkReport(
            {f: n for f in Fault if (n := self._parser.faults[f] - self._faults_before[f])},
            continuity.lost,
            continuity.misplaced,
            continuity.restarts,
            continuity.wraps,
            self._reader.reopened,
            self._box.refused,
            tuple(self._events),
        )

    def start(self) -> None:
        """Let it send its measurements; after a restart of the device this is repeated by itself."""
        self._started = True
        self._reader.write(b"S\n")

    def pause(self) -> None:
        """Let it send heartbeats only."""
        self._started = False
        self._reader.write(b"P\n")

    def take(self, within_s: float = IO_TIMEOUT_S) -> list[Placed]:
        """The lines since the last call, in order; waits up to `within_s` [s, at most 1] for the first.

        Raises:
            InstrumentLost: unplugged for good, or silent for a second although it should send heartbeats.
        """
        lines = self._box.take(min(within_s, IO_TIMEOUT_S))
        if not lines:
            self._check_silence()
        return lines

    def check(self) -> None:
        """Whether it is still there, without taking anything.

        Raises:
            InstrumentLost: as for :meth:`take`; also while it is unplugged and waited for.
        """
        if self._box.failure is not None:
            raise self._box.failure
        if self._reader.away:
            raise InstrumentLost(f"{self.device} is unplugged")
        self._check_silence()

    def _check_silence(self) -> None:
        if not self._reader.away and self._clock() - self._heard > self.patience * SILENCE_MAX_S:
            raise InstrumentLost(
                f"{self.device}: no heartbeat for {self._clock() - self._heard:.1f} s. The device hangs or "
                "its cable is loose (a motor that stands still does not stop the heartbeat)"
            )

    def mark(self, tag: str) -> Placed:
        """Send a mark and wait for its echo, whose ticks are the device's time of the mark.

        Raises:
            InstrumentInputError: the tag is not 1 to 16 letters, digits, "_", "." or "-".
            InstrumentTimeout: no echo within the time that the address gives to answers.
        """
        if not _TAG.fullmatch(tag):
            raise InstrumentInputError(f"{tag!r} is no mark: 1 to 16 letters, digits, '_', '.' or '-'")
        with self._marked:
            self._marks.pop(tag, None)
            self._reader.write(f"M{tag}\n".encode("ascii"))
            within = self.patience * self._answer_s
            if not self._marked.wait_for(lambda: tag in self._marks, within):
                raise InstrumentTimeout(f"{self.device}: the mark {tag!r} was not echoed within {within:g} s")
            return self._marks[tag]

    def close(self) -> None:
        """Stop reading and close the port; idempotent."""
        self._reader.stop()

    # On the reader's thread.

    def _on_bytes(self, data: bytes, receipt: float) -> None:
        for line in self._parser.feed(data):
            self._heard = receipt
            if isinstance(line, Banner):
                self._on_banner(line)
                continue
            for placed in self._continuity.place(line, receipt):
                self._deliver(placed)

    def _deliver(self, placed: Placed) -> None:
        self._box.put(placed)
        if placed.epoch != self._epoch:
            self._epoch = placed.epoch
            self._start_again()
        if isinstance(placed.line, EventLine):
            self._events.append(placed.line)
        elif isinstance(placed.line, MarkLine):
            with self._marked:
                self._marks[placed.line.tag] = placed
                self._marked.notify_all()

    def _on_banner(self, banner: Banner) -> None:
        if banner.kind is not self.banner.kind:
            self._box.fail(WrongDevice(_kind_text(self.device, banner, self.banner.kind)))
            return
        self.banner = banner
        self._continuity.banner(banner)
        self._start_again()

    def _start_again(self) -> None:
        """A device that has just booted waits for its start."""
        if self._started:
            self._reader.write(b"S\n")

    def _on_reopened(self) -> None:
        self._parser.reset()
        self._heard = self._clock()
        self._reader.write(b"?\n")


class LineInstrument(Closing):
    """What speaks through a line device.

    Args:
        address, clock, reconnect, handshake_s: as for :class:`LineDevice`, with its errors.
    """

    kind: Kind

    def __init__(
        self,
        address: str,
        *,
        clock: Clock = monotonic,
        reconnect: Reconnect | None = None,
        handshake_s: float = HANDSHAKE_S,
    ) -> None:
        self._clock = clock
        self._device = LineDevice(
            address, self.kind, clock=clock, reconnect=reconnect, handshake_s=handshake_s
        )
        self._opened()

    def _opened(self) -> None:
        """Its banner has come."""

    @property
    def banner(self) -> Banner:
        """Who it is."""
        return self._device.banner

    @property
    def device(self) -> str:
        """Name of its port now."""
        return self._device.device

    def wait_as_long_as(self, patience: float) -> None:
        """Its silence may last so many seconds."""
        self._device.patience = patience

    def check(self) -> None:
        """Raise InstrumentLost when it is gone or silent; takes nothing, from any thread."""
        self._device.check()

    def close(self) -> None:
        """Close it; idempotent."""
        self._device.close()


def _handshake(port: SerialPort, parser: LineParser, clock: Clock, within_s: float) -> Banner:
    """Ask until the device says who it is; what came before its banner does not count."""
    heard = b""
    start = clock()
    asked = float("-inf")
    while clock() - start < within_s:
        if clock() - asked >= _ASK_EVERY_S:
            port.write(b"?\n")
            asked = clock()
        data = port.read(_ASK_EVERY_S)
        heard = (heard + data)[-4096:]
        for line in parser.feed(data):
            if isinstance(line, Banner):
                return line
    raise no_banner(port.address.device, port.address.baud, within_s, heard)


def _kind_text(device: str, banner: Banner, wanted: Kind) -> str:
    names = {Kind.TACHOMETER: "tachometer", Kind.LOAD_CELL: "load cell"}
    return (
        f"{device} is the {names[banner.kind]} {banner.uid}, not a {names[wanted]}: "
        "give the other port, or let both be searched"
    )
