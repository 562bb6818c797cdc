"""Puts the lines of a device on one time axis: lost lines, wraps of its clock, restarts. Pure.

The sequence number tells how many lines are missing, the difference of ticks modulo 2**32 continues the
clock beyond its wrap after 71.6 min. Together they tell a restart (numbers begin anew, the clock goes back)
from a wrap (numbers go on).

A line that does not follow directly on its predecessor waits for the next one: of the two stories, "lines
were lost" and "this number is wrong", the next line knows which is true. So an 8-bit checksum that let a
wrong number pass neither invents losses nor moves the clock.
"""

from dataclasses import dataclass

from calibration.bench.instruments.protocol import Banner, SequencedLine

_SEQ_RANGE, _TICK_RANGE = 1 << 16, 1 << 32
#: A line may carry a time before that of its predecessor, because edges wait for their group [us].
_BACK_US = 3_000_000
#: A heartbeat takes a number every 100 ms, and a line 1.5 ms of a wire of 115200 baud: when numbers are
#: missing, each has taken a time between these [us].
_NUMBER_MIN_US, _NUMBER_MAX_US = 1_000, 150_000
#: More missing numbers than this are another story [lines].
_GAP_MAX = 20_000
#: A device that has just booted has not yet sent more [lines].
_BOOT_SEQ = 1_000


@dataclass(frozen=True, slots=True)
class Placed:
    """A line in its place.

    Attributes:
        line: the line.
        epoch: counts the restarts of the device; times of different epochs have nothing in common.
        ticks: its time on the device's clock, wraps undone [us].
        lost: lines missing directly before it.
        receipt: when it arrived, host clock [s].
    """

    line: SequencedLine
    epoch: int
    ticks: int
    lost: int
    receipt: float


class Continuity:
    """Follows one device.

    Attributes:
        lost: lines that are missing.
        restarts: times that the device began anew.
        wraps: times that its clock wrapped.
        misplaced: lines with a correct checksum that fit nowhere, thrown away.
    """

    def __init__(self) -> None:
        self.lost = self.restarts = self.wraps = self.misplaced = 0
        self._epoch = 0
        self._last: tuple[int, int] | None = None  # sequence number, ticks
        self._waiting: tuple[SequencedLine, float] | None = None
        self._banner_seen = False
        self._cycle = 0

    def banner(self, _banner: Banner) -> None:
        """A banner came: at a boot, or because the host asked. What follows decides."""
        self._banner_seen = True

    def place(self, line: SequencedLine, receipt: float) -> list[Placed]:
        """Take the next line; what is in its place now, in order (0, 1 or 2 lines)."""
        placed = self.finish() if self._is_boot(line) else self._settle(line)
        if self._last is None or self._is_next(line) or self._is_boot(line):
            return [*placed, self._accept(line, receipt)]
        self._waiting = (line, receipt)
        return placed

    def finish(self) -> list[Placed]:
        """Nothing comes any more: a waiting line is believed if its loss is plausible."""
        if self._waiting is None:
            return []
        (line, receipt), self._waiting = self._waiting, None
        if self._last is not None and _follows_pause(self._last, line):
            return [self._accept(line, receipt)]
        self.misplaced += 1
        return []

    def _settle(self, following: SequencedLine) -> list[Placed]:
        """Decide on the waiting line by the one that follows it."""
        if self._waiting is None or self._last is None:
            return []
        (line, receipt), self._waiting = self._waiting, None
        continued = _follows((line.seq, line.tick), following)
        contradicted = not continued and _follows(self._last, following)
        restarted = continued and not _follows(self._last, following)
        if not contradicted if _follows_pause(self._last, line) else restarted:
            return [self._accept(line, receipt)]
        self.misplaced += 1
        return []

    def _is_next(self, line: SequencedLine) -> bool:
        return self._last is not None and _gap(self._last[0], line.seq) == 0 and _follows(self._last, line)

    def _is_boot(self, line: SequencedLine) -> bool:
        """A banner, and numbers and clock that went back."""
        return (
            self._banner_seen
            and self._last is not None
            and line.seq < _BOOT_SEQ
            and not _follows(self._last, line)
        )

    def _accept(self, line: SequencedLine, receipt: float) -> Placed:
        lost = 0
        ticks = line.tick
        if self._last is not None:
            if _follows_pause(self._last, line):
                lost = _gap(self._last[0], line.seq)
                ticks = self._last[1] + _step(self._last[1], line.tick)
                self._count_wraps(ticks)
            else:
                self.restarts += 1
                self._epoch += 1
                self._cycle = 0
                lost = line.seq if line.seq < _BOOT_SEQ else 0
        self._banner_seen = False
        self.lost += lost
        self._last = (line.seq, ticks)
        return Placed(line, self._epoch, ticks, lost, receipt)

    def _count_wraps(self, ticks: int) -> None:
        cycle = ticks // _TICK_RANGE
        self.wraps += max(0, cycle - self._cycle)
        self._cycle = max(cycle, self._cycle)


def _gap(last_seq: int, seq: int) -> int:
    """Numbers missing between the two."""
    return (seq - last_seq - 1) % _SEQ_RANGE


def _step(last_ticks: int, tick: int) -> int:
    """Signed difference, the shorter way around [us]."""
    step = (tick - last_ticks) % _TICK_RANGE
    return step if step < _TICK_RANGE // 2 else step - _TICK_RANGE


def _follows(last: tuple[int, int], line: SequencedLine) -> bool:
    """Whether `line` can be a later line of the same run, others between them being lost."""
    gap, step = _gap(last[0], line.seq), _step(last[1], line.tick)
    low, high = gap * _NUMBER_MIN_US - _BACK_US, gap * _NUMBER_MAX_US + _BACK_US
    return gap <= _GAP_MAX and low <= step <= high


def _follows_pause(last: tuple[int, int], line: SequencedLine) -> bool:
    """As :func:`_follows`, or the very next number after a pause of any length."""
    pause = _gap(last[0], line.seq) == 0 and _step(last[1], line.tick) > 0
    return pause or _follows(last, line)
