"""10,000 faults on the line: no wrong value is accepted, losses are counted exactly, the clock holds."""

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
import pytest

from calibration.bench.instruments.continuity import Continuity, Placed
from calibration.bench.instruments.protocol import (
    Banner,
    EdgeLine,
    HeartbeatLine,
    LineParser,
    LoadLine,
    MarkLine,
    SequencedLine,
)
from tests.instruments.pty_device import crc_framed, framed
from tests.tiers import some

Rng = np.random.Generator
WRAP = 1 << 32


@dataclass
class Speaker:
    """A device with known truth: what it said under each number of each run."""

    rng: Rng
    frame: Callable[[str], bytes]
    protocol: int
    epoch: int = 0
    seq: int = 0
    ticks: int = WRAP - 3_000_000
    total: int = 0
    said: dict[tuple[int, int], tuple[int, object]] = field(default_factory=dict)

    def banner(self) -> bytes:
        return self.frame(f"I,{self.protocol},tach,1.0,u-1,4")

    def line(self) -> bytes:
        """The next line: mostly edges, some heartbeats, marks and counts."""
        self.ticks += int(self.rng.integers(8_000, 12_000))
        kind = self.rng.choice(["E", "H", "L", "M"], p=[0.7, 0.1, 0.15, 0.05])
        if kind == "E":
            steps = [int(step) for step in self.rng.integers(250, 1_250, size=int(self.rng.integers(0, 8)))]
            self.total += 1 + len(steps)
            ticks = [self.ticks % WRAP]
            for step in steps:
                ticks.append((ticks[-1] + step) % WRAP)
            return self._numbered("E", steps, tuple(ticks))
        if kind == "H":
            return self._numbered("H", [self.total, 0, 1], (self.total, 0, 1))
        if kind == "L":
            raw = int(self.rng.integers(-(1 << 23), 1 << 23))
            return self._numbered("L", [raw], raw)
        return self._numbered("M", [f"t{self.seq}"], f"t{self.seq}")

    def restart(self) -> bytes:
        self.epoch += 1
        self.seq = 0
        self.ticks = 4_000
        return self.banner()

    def _numbered(self, kind: str, fields: list[object], value: object) -> bytes:
        self.said[self.epoch, self.seq] = (self.ticks, value)
        text = ",".join(map(str, [kind, self.seq, self.ticks % WRAP, *fields]))
        self.seq += 1
        return self.frame(text)


def content(line: SequencedLine) -> object:
    if isinstance(line, EdgeLine):
        return line.ticks
    if isinstance(line, HeartbeatLine):
        return (line.total, line.overflow, line.level)
    if isinstance(line, LoadLine):
        return line.raw
    assert isinstance(line, MarkLine)
    return line.tag


def flip(line: bytes, rng: Rng) -> bytes:
    data = bytearray(line)
    data[int(rng.integers(len(data)))] ^= 1 << int(rng.integers(8))
    return bytes(data)


def lose(line: bytes, rng: Rng) -> bytes:
    at = int(rng.integers(len(line)))
    return line[:at] + line[at + 1 :]


def cut(line: bytes, rng: Rng) -> bytes:
    return line[: int(rng.integers(1, len(line)))]


def pepper(line: bytes, rng: Rng) -> bytes:
    at = int(rng.integers(len(line) + 1))
    return line[:at] + bytes(rng.choice([0x00, 0xFF], size=int(rng.integers(1, 5))).tolist()) + line[at:]


def swap_byte(line: bytes, rng: Rng) -> bytes:
    data = bytearray(line)
    data[int(rng.integers(len(data)))] = int(rng.integers(256))
    return bytes(data)


FAULTS = [flip, lose, cut, pepper, swap_byte]


def spoilt(speaker: Speaker, count: int, rng: Rng, chance: float) -> bytes:
    """`count` lines, every one spoilt with this chance in one way; line ends lost, doubled and mixed;
    restarts in the middle."""
    out = [speaker.banner() + b"\n"]
    for index in range(count):
        if index in (count // 3, 2 * count // 3):
            out += [speaker.line()[:9], speaker.restart(), b"\r\n"]
        line = speaker.line()
        end = (b"\n", b"\r\n", b"\n\r\n")[int(rng.integers(3))]
        if index > 3 and rng.random() < chance:
            which = int(rng.integers(len(FAULTS) + 1))
            line, end = (line, b"") if which == len(FAULTS) else (FAULTS[which](line, rng), end)
        out += [line, end]
    return b"".join(out)


def heard(data: bytes, rng: Rng) -> tuple[list[Placed], LineParser, Continuity]:
    """What parser and continuity make of bytes that arrive in pieces."""
    parser, continuity, placed, at = LineParser(), Continuity(), [], 0
    while at < len(data):
        piece = int(rng.integers(1, 200))
        for line in parser.feed(data[at : at + piece]):
            if isinstance(line, Banner):
                continuity.banner(line)
            else:
                placed += continuity.place(line, 0.0)
        at += piece
    return placed + continuity.finish(), parser, continuity


def wrong(placed: list[Placed], said: dict[tuple[int, int], tuple[int, object]]) -> list[Placed]:
    """Accepted lines that the device has never said so, or at another time."""
    return [one for one in placed if said.get((one.epoch, one.line.seq)) != (one.ticks, content(one.line))]


def countable(placed: list[Placed]) -> int:
    """Lines said up to the last accepted one of each epoch; what was lost after it nobody can know."""
    return sum(max(one.line.seq for one in placed if one.epoch == epoch) + 1 for epoch in range(3))


@pytest.mark.parametrize(("frame", "protocol"), some([(crc_framed, 2), (framed, 1)], 2))
def test_ten_thousand_spoilt_lines(frame: Callable[[str], bytes], protocol: int) -> None:
    rng = np.random.default_rng(50 + protocol)
    speaker = Speaker(rng, frame, protocol)
    data = spoilt(speaker, 25_000, rng, 0.42)
    placed, parser, continuity = heard(data, rng)
    assert sum(parser.faults.values()) > 9_000
    assert wrong(placed, speaker.said) == []
    assert (continuity.restarts, continuity.misplaced) == (2, 0)
    assert continuity.lost + len(placed) == countable(placed)
    assert len(placed) > 12_000


def test_one_percent_of_all_bytes_spoilt() -> None:
    """Half of all lines die, many with two flipped bits: this is what protocol 2 is for."""
    rng = np.random.default_rng(53)
    speaker = Speaker(rng, crc_framed, 2)
    data = bytearray(spoilt(speaker, 15_000, rng, 0.0))
    first = data.index(b"\n", data.index(b",0,")) + 1
    hits = np.flatnonzero(rng.random(len(data)) < 0.01)
    hits = hits[hits >= first]  # the banner and the first number are whole
    assert hits.size > 4_000
    for at in hits:
        data[at] ^= 1 << int(rng.integers(8))
    placed, _parser, continuity = heard(bytes(data), rng)
    assert wrong(placed, speaker.said) == []
    assert (continuity.restarts, continuity.misplaced) == (2, 0)
    assert len(placed) > 8_000
    assert continuity.lost + len(placed) == countable(placed) > len(speaker.said) - 40


def test_wrong_numbers_that_the_xor_lets_pass_do_not_move_the_clock() -> None:
    """Protocol 1 misses two equal flips. Then a value can be wrong, but no epoch, no clock, no loss."""
    rng = np.random.default_rng(54)
    speaker = Speaker(rng, framed, 1)
    data = bytearray(spoilt(speaker, 8_000, rng, 0.0))
    first = data.index(b"\n") + 1
    for at in np.flatnonzero(rng.random(len(data)) < 0.01):
        data[at] ^= 1 << int(rng.integers(8)) if at >= first else 0
    placed, _parser, continuity = heard(bytes(data), rng)
    assert continuity.restarts == 2
    assert len(wrong(placed, speaker.said)) < 0.01 * len(placed)
    assert all(abs(one.ticks - speaker.said[one.epoch, one.line.seq][0]) < 4_000_000 for one in placed)
