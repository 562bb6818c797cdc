"""Edges and lines of the simulated tachometer."""

import math

import numpy as np
import pytest

from sim_backend.bench.board import Board
from sim_backend.bench.faults import BenchFaults
from sim_backend.bench.line_protocol import checksum, line
from sim_backend.bench.tachometer import OpticalSensor, TachometerBoard

SPEED = 1000.0


def edges_of(faults: BenchFaults, speeds: np.ndarray, seed: int = 0) -> np.ndarray:
    """True times (s) of the edges of a propeller with these speeds (rad/s) at the ends of ms."""
    sensor = OpticalSensor(np.random.default_rng(seed), faults)
    found: list[float] = []
    for tick in range(1, len(speeds)):
        found += sensor.step(tick / 1000, 0.001, float(speeds[tick - 1]), float(speeds[tick]))
    return np.array(found)


def received(board: Board, time: float) -> list[bytes]:
    """Complete lines that arrived by `time`."""
    return board.wire.take(time).split(b"\n")[:-1]


def test_golden_lines() -> None:
    """Exclusive or of the bytes, worked out by hand."""
    # A is 41, B is 42, the comma 2C: 41 ^ 42 = 03, 03 ^ 2C = 2F.
    assert line(1, "A", "B") == b"A,B*2F"
    # The digits 0 4 0 0 1 leave 30 ^ 34 ^ 30 ^ 30 ^ 31 = 35, with H 48 ^ 35 = 7D, five commas leave one 2C.
    assert line(1, "H", 0, 4, 0, 0, 1) == b"H,0,4,0,0,1*51"
    # A sentence of NMEA 0183 that is printed in many manuals.
    assert checksum("GPGLL,5300.97914,N,00259.98174,E,125926,A") == 0x28
    # The published check value of this CRC: "123456789" gives 29B1.
    assert line(2, "123456789") == b"123456789*29B1"


def test_banner_first_then_heartbeats_also_when_stopped() -> None:
    board = TachometerBoard(np.random.default_rng(1), BenchFaults(resonator=0.0))
    for tick in range(1, 351):
        board.step(tick / 1000)
    lines = received(board, 0.36)
    assert lines[0].startswith(b"I,1,tach,sim1,")
    assert lines[0].split(b"*")[0].endswith(b",4")
    assert [text.split(b"*")[0] for text in lines[1:]] == [
        b"H,0,100000,0,0,1", b"H,1,200000,0,0,1", b"H,2,300000,0,0,1",
    ]  # fmt: skip


def test_edges_are_grouped_by_eight_with_differences_and_nothing_before_start() -> None:
    board = TachometerBoard(np.random.default_rng(1), BenchFaults(resonator=0.0))
    board.edges([0.0101])
    board.step(0.02)
    board.receive(b"S\n", 0.021)
    board.edges([0.030002 + 0.002 * i for i in range(10)])
    for tick in range(21, 120):
        board.step(tick / 1000)
    lines = [text for text in received(board, 0.13) if text.startswith(b"E")]
    assert lines == [
        line(1, "E", 0, 30000, *([2000] * 7)),
        line(1, "E", 1, 46000, 2000),
    ]


def test_edge_count_is_the_integral_of_the_speed() -> None:
    speeds = np.concatenate([np.linspace(0.0, 2500.0, 2000), np.linspace(2500.0, 100.0, 3000)])
    found = edges_of(BenchFaults(missed=0.0, doubled=0.0), speeds)
    turns = np.trapezoid(speeds, dx=1e-3) / (2 * math.pi)
    assert len(found) == pytest.approx(2 * turns, abs=2)
    assert np.all(np.diff(found) > 0.0)
    # Revolution by revolution the speed is that of the motor, also while it changes.
    middle = 0.5 * (found[2:] + found[:-2])
    rate = 2 * math.pi / (found[2:] - found[:-2])
    true = np.interp(middle, np.arange(len(speeds)) * 1e-3, speeds)
    fast = true > 300.0
    assert np.max(np.abs(rate[fast] / true[fast] - 1)) < 0.01


def test_marks_are_uneven_and_jitter_a_little() -> None:
    found = edges_of(BenchFaults(missed=0.0, doubled=0.0), np.full(20_001, SPEED))
    gaps = np.diff(found)
    ratio = gaps[::2].mean() / gaps[1::2].mean()
    assert max(ratio, 1 / ratio) == pytest.approx(1.02 / 0.98, abs=1e-3)
    revolutions = found[2:] - found[:-2]
    assert revolutions.mean() == pytest.approx(2 * math.pi / SPEED, rel=1e-5)
    assert revolutions.std() == pytest.approx(math.sqrt(2) * 3e-6, rel=0.1)


@pytest.mark.parametrize(("missed", "doubled"), [(0.02, 0.0), (0.0, 0.01), (0.02, 0.01)])
def test_missed_and_doubled_edges_have_their_rates(missed: float, doubled: float) -> None:
    found = edges_of(BenchFaults(missed=missed, doubled=doubled), np.full(60_001, SPEED))
    gaps = np.diff(found) / (math.pi / SPEED)
    true = 60.0 * SPEED / math.pi
    assert np.sum(gaps > 1.8) == pytest.approx(missed * true, abs=4 * math.sqrt(missed * true) + 1)
    assert np.sum(gaps < 0.45) == pytest.approx(doubled * true, abs=4 * math.sqrt(doubled * true) + 1)


def test_three_blades_are_half_as_many_edges_again() -> None:
    found = edges_of(BenchFaults(blades=3, missed=0.0, doubled=0.0), np.full(5001, SPEED))
    assert len(found) == pytest.approx(3 * 5.0 * SPEED / (2 * math.pi), abs=2)


def test_mains_light_is_seen_whatever_turns() -> None:
    for speed in (0.0, SPEED):
        found = edges_of(BenchFaults(flicker=100.0), np.full(2001, speed))
        assert len(found) == pytest.approx(200, abs=1)
        assert np.diff(found) == pytest.approx(np.full(len(found) - 1, 0.01), abs=2e-4)


def test_clock_is_wrong_by_the_resonator_and_has_ticks_of_four() -> None:
    board = TachometerBoard(np.random.default_rng(1), BenchFaults(resonator=0.004))
    assert board.micros(60.0) == 60_240_000
    assert board.micros(0.0123456) == int(0.0123456e6 * 1.004) // 4 * 4


def test_clock_wraps_in_the_middle_of_a_group() -> None:
    board = TachometerBoard(np.random.default_rng(1), BenchFaults(resonator=0.0, wrap_in=0.0505))
    board.receive(b"S", 0.0)
    board.edges([0.047 + 0.001 * i for i in range(8)])
    for tick in range(1, 60):
        board.step(tick / 1000)
    (text,) = [t for t in received(board, 0.06) if t.startswith(b"E")]
    assert text == line(1, "E", 0, 2**32 - 3500, *([1000] * 7))


def test_marks_are_echoed_and_rubbish_is_not() -> None:
    board = TachometerBoard(np.random.default_rng(1), BenchFaults(resonator=0.0))
    received(board, 0.05)
    board.receive(b"Mgo-1\nzz\x00M", 0.06)
    board.receive(b"two\r\n", 0.07)
    assert received(board, 0.2) == [line(1, "M", 0, 60000, "go-1"), line(1, "M", 1, 70000, "two")]


def test_overflow_is_counted_and_the_total_is_what_arrives() -> None:
    board = TachometerBoard(np.random.default_rng(1), BenchFaults(resonator=0.0, overflow_at=0.2))
    board.receive(b"S", 0.0)
    for tick in range(1, 1001):
        board.edges([tick / 1000 - 0.0005])
        board.step(tick / 1000)
    lines = [text.split(b"*")[0].split(b",") for text in received(board, 1.1)]
    sent = sum(len(fields) - 2 for fields in lines if fields[0] == b"E")
    beat = [fields for fields in lines if fields[0] == b"H"][-1]
    assert [int(field) for field in beat[3:5]] == [1000 - 64, 64]
    assert sent == pytest.approx(1000 - 64, abs=8)


def test_reset_starts_anew_and_stops() -> None:
    board = TachometerBoard(np.random.default_rng(1), BenchFaults(resonator=0.0, reset_at=(0.5,)))
    board.receive(b"S", 0.0)
    for tick in range(1, 1500):
        board.edges([tick / 1000])
        board.step(tick / 1000)
    assert not board.running
    assert board.starts == 2
    after = board.wire.take(1.6).rpartition(b"\xff")[2].split(b"\n")
    assert after[1].startswith(b"I,1,tach")
    assert after[2].split(b"*")[0] == b"H,0,100000,0,0,1"
