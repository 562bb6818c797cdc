"""The tachometer: every edge with its time, whether the link lives, and marks on its own clock.

>>> with Tachometer("/dev/ttyACM0") as tachometer:                # doctest: +SKIP
...     tachometer.start()
...     mark = tachometer.mark("step1")
...     batch = tachometer.take()

Speed is not computed here: blades, missed and doubled edges belong to ``calibration.bench.motors``.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from calibration.bench.instruments.continuity import Placed
from calibration.bench.instruments.edge_count import EdgeCount
from calibration.bench.instruments.line_device import LineInstrument, LinkReport
from calibration.bench.instruments.protocol import EdgeLine, HeartbeatLine, Kind, MarkLine
from calibration.bench.instruments.transport import IO_TIMEOUT_S

_US = 1e-6
#: A start has arrived at the device by then [s].
_SETTLE_S = 0.3


@dataclass(frozen=True, slots=True)
class Mark:
    """A mark that the host set: `time` on the tachometer's clock [s], `receipt` of its echo [s, host]."""

    tag: str
    time: float
    receipt: float


@dataclass(frozen=True, slots=True)
class TachometerBatch:
    """What the tachometer sent since the last look. Times of one epoch have one origin, its boot.

    Attributes:
        epoch: counts restarts; batches of different epochs must not be joined.
        edges: (n,), times of the edges on the tachometer's clock [s], wraps undone.
        beat_times: (m,), times of heartbeats on the tachometer's clock [s].
        beat_receipts: (m,), when they arrived, host clock [s]; the pair calibrates the clock. Arrival is
            late, never early.
        marks: marks echoed.
        lost_lines: lines missing within this batch; edges may be missing there.
    """

    epoch: int
    edges: NDArray[np.float64]
    beat_times: NDArray[np.float64]
    beat_receipts: NDArray[np.float64]
    marks: tuple[Mark, ...]
    lost_lines: int

    @property
    def alive(self) -> bool:
        """Whether a heartbeat came; a motor at rest sends heartbeats and no edges."""
        return self.beat_times.size > 0


@dataclass(frozen=True, slots=True)
class TachometerReport:
    """What was lost.

    Attributes:
        link: of the line protocol.
        lost_edges: edges that the device counted and that did not arrive.
        overflow: edges that the device itself lost.
    """

    link: LinkReport
    lost_edges: int
    overflow: int


class Tachometer(LineInstrument):
    """An open tachometer; a context manager."""

    kind = Kind.TACHOMETER

    def _opened(self) -> None:
        self._count = EdgeCount()
        self._epoch = 0
        self._kept: list[Placed] = []
        self._run = (math.inf, math.inf)
        self._last_edge = -1

    @property
    def report(self) -> TachometerReport:
        """What was lost in what has been taken so far."""
        return TachometerReport(self._device.report, self._count.lost, self._count.overflow)

    def start(self) -> None:
        """Let it send edges. That none is lost is watched from 0.3 s later on."""
        self._run = (self._clock() + _SETTLE_S, math.inf)
        self._device.start()

    def pause(self) -> None:
        """Heartbeats only."""
        self._run = (self._run[0], self._clock())
        self._device.pause()

    def mark(self, tag: str) -> Mark:
        """Set a mark; returns its time on the tachometer's clock. It comes in a batch, too.

        Raises:
            InstrumentInputError, InstrumentTimeout, InstrumentLost.
        """
        return _mark(self._device.mark(tag))

    def take(self, within_s: float = IO_TIMEOUT_S) -> TachometerBatch:
        """What came since the last call; waits up to `within_s` [s, at most 1]. Ends where an epoch ends.

        Raises:
            InstrumentLost: unplugged for good, or no heartbeat for 1 s.
        """
        placed = self._kept or self._device.take(within_s)
        if placed and placed[0].epoch != self._epoch:
            self._epoch = placed[0].epoch
            self._count.restart()
            self._last_edge = -1
        here = [one for one in placed if one.epoch == self._epoch]
        self._kept = placed[len(here) :]
        return self._batch(here)

    def _batch(self, placed: Sequence[Placed]) -> TachometerBatch:
        edges: list[int] = []
        beats: list[tuple[int, float]] = []
        marks: list[Mark] = []
        for one in placed:
            if isinstance(one.line, EdgeLine):
                ticks = unwrapped_edges(one)
                if ticks[0] <= self._last_edge:
                    continue  # before one that came earlier: the device's count will find them lost
                self._last_edge = ticks[-1]
                self._count.edges(ticks)
                edges.extend(ticks)
            elif isinstance(one.line, HeartbeatLine):
                self._count_edges(one, one.line)
                beats.append((one.ticks, one.receipt))
            elif isinstance(one.line, MarkLine):
                marks.append(_mark(one))
        return TachometerBatch(
            self._epoch,
            _US * np.array(edges, dtype=np.float64),
            _US * np.array([beat[0] for beat in beats], dtype=np.float64),
            np.array([beat[1] for beat in beats], dtype=np.float64),
            tuple(marks),
            sum(one.lost for one in placed),
        )

    def _count_edges(self, placed: Placed, line: HeartbeatLine) -> None:
        """Edges that pass while it is not started are counted by the device, and not sent."""
        if self._run[0] <= placed.receipt < self._run[1]:
            self._count.heartbeat(placed.ticks, line.total, line.overflow)
        else:
            self._count.restart()


def unwrapped_edges(placed: Placed) -> tuple[int, ...]:
    """Times of the edges of an E line in its place [us]."""
    line = placed.line
    assert isinstance(line, EdgeLine)
    return tuple(placed.ticks + (tick - line.tick) % (1 << 32) for tick in line.ticks)


def _mark(placed: Placed) -> Mark:
    assert isinstance(placed.line, MarkLine)
    return Mark(placed.line.tag, _US * placed.ticks, placed.receipt)
