"""The serial line: its pace and its accidents."""

import re

import numpy as np
import pytest

from sim_backend.bench.faults import BenchFaults
from sim_backend.bench.line_protocol import checksum, line
from sim_backend.bench.wire import Wire
from sim_backend.fault_values import FaultWindow

TEXT = line(1, "E", 12345, 4_000_000_000, 1200, 1204, 1200, 1204, 1200, 1204, 1200)


def sent(count: int, **faults: object) -> bytes:
    """`count` lines through a wire with these faults."""
    wire = Wire(115200, np.random.default_rng(0), BenchFaults(**faults))  # type: ignore[arg-type]
    wire.take(0.0)
    for _ in range(count):
        wire.send_line(TEXT)
    return wire.take(1e6)


def right(text: bytes) -> bool:
    """Whether a line is whole and agrees with its checksum."""
    match = re.fullmatch(rb"([A-Z],[ -)+-~]*)\*([0-9A-F]{2})", text)
    return match is not None and checksum(match[1].decode()) == int(match[2], 16)


def test_bytes_come_at_the_baud_rate() -> None:
    wire = Wire(115200, np.random.default_rng(0), BenchFaults())
    wire.take(5.0)
    for _ in range(100):
        wire.send_line(TEXT)
    total = wire.pending
    counts = [len(wire.take(5.0 + 0.01 * i)) for i in range(1, 11)]
    assert sum(counts) == pytest.approx(0.1 * 11520, abs=1)
    assert max(counts) <= 116
    assert wire.pending == total - sum(counts)
    rest = wire.take(10.0)
    assert len(rest) == total - sum(counts)


def test_an_idle_line_saves_no_time_up() -> None:
    wire = Wire(115200, np.random.default_rng(0), BenchFaults())
    for second in range(10):
        wire.take(float(second))
    wire.send_line(TEXT)
    assert wire.take(9.001) == TEXT[:11]


def test_stall_holds_back_and_bursts() -> None:
    wire = Wire(115200, np.random.default_rng(0), BenchFaults(stall=FaultWindow(1.0, 1.3)))
    wire.take(0.999)
    wire.send_line(TEXT)
    wire.send_line(TEXT)
    assert wire.take(1.0) == b""
    assert wire.take(1.299) == b""
    assert wire.take(1.3) == 2 * (TEXT + b"\n")


def test_line_ends() -> None:
    assert sent(3) == 3 * (TEXT + b"\n")
    assert sent(3, line_ends="crlf") == 3 * (TEXT + b"\r\n")
    mixed = sent(200, line_ends="mix")
    assert 60 < mixed.count(b"\r\n") < 140
    assert mixed.count(b"\n") == 200


def test_merged_and_cut_lines() -> None:
    merged = sent(1000, merge_line=0.1).split(b"\n")
    assert 850 < len(merged) < 950
    assert b"".join(merged) == 1000 * TEXT
    cut = sent(1000, cut_line=0.1).split(b"\n")
    assert 850 < len(cut) < 950
    assert all(text.endswith(TEXT) for text in cut[:-1])


def test_garbage_and_flips_are_seen_and_rare() -> None:
    spoilt = sent(1000, garbage=0.05).split(b"\n")
    foreign = [text for text in spoilt if b"\x00" in text or b"\xff" in text]
    assert 25 < len(foreign) < 80
    data = np.frombuffer(sent(1000, flip=0.01), dtype=np.uint8)
    clean = np.frombuffer(sent(1000), dtype=np.uint8)
    changed = np.flatnonzero(data != clean)
    assert 0.008 * len(clean) < len(changed) < 0.012 * len(clean)
    assert {int(bits).bit_count() for bits in (data ^ clean)[changed]} == {1}


def test_whole_lines_have_the_right_checksum_and_spoilt_ones_have_not() -> None:
    assert right(TEXT)
    for index in range(len(TEXT)):
        for bit in range(8):
            damaged = bytearray(TEXT)
            damaged[index] ^= 1 << bit
            assert not right(bytes(damaged)), bytes(damaged)
