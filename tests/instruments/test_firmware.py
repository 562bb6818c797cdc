"""The sketches, compiled for the PC against a small Arduino core: their lines through our parser."""

import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

from calibration.bench.instruments.continuity import Continuity, Placed
from calibration.bench.instruments.edge_count import EdgeCount
from calibration.bench.instruments.protocol import (
    Banner,
    EdgeLine,
    EventLine,
    HeartbeatLine,
    Kind,
    LineParser,
    LoadLine,
    MarkLine,
)
from calibration.bench.instruments.tachometer import unwrapped_edges

FIRMWARE = Path(__file__).resolve().parents[2] / "calibration" / "firmware"
STUB = Path(__file__).resolve().parent / "arduino_stub"
SKETCHES = ("tachometer", "load_cell")
WRAP = 1 << 32


@pytest.fixture(scope="session")
def sketches(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """Both sketches as programs of this computer."""
    compiler = shutil.which("g++") or shutil.which("clang++") or shutil.which("c++")
    if compiler is None:
        pytest.skip("no C++ compiler (g++, clang++) to run the sketches on this computer")
    folder = tmp_path_factory.mktemp("sketches")
    for name in SKETCHES:
        subprocess.run(
            [
                *(compiler, "-std=c++11", "-O1", "-Wall", "-Wextra", "-Werror"),
                *("-I", str(STUB), "-I", str(FIRMWARE / name), f'-DSKETCH="{name}.ino"'),
                *(str(STUB / "sketch_host.cpp"), "-o", str(folder / name)),
            ],
            check=True,
            capture_output=True,
        )
    return {name: folder / name for name in SKETCHES}


def run(program: Path, events: list[tuple[float, str]], until_us: float, begin_us: int = 0) -> bytes:
    """What the sketch sends during a script of ``(time in us, "KIND text")``."""
    lines = [f"B {begin_us}"]
    for time, event in sorted([*events, (until_us, "Q ")]):
        kind, _, text = event.partition(" ")
        lines.append(f"{kind} {time:.1f} {text}")
    return subprocess.run(
        [program], input="\n".join(lines).encode() + b"\n", check=True, capture_output=True, timeout=120
    ).stdout


def parsed(data: bytes) -> tuple[Banner, list[Placed], Continuity]:
    parser, continuity, placed = LineParser(), Continuity(), []
    lines = parser.feed(data)
    banners = [line for line in lines if isinstance(line, Banner)]
    for line in lines:
        if not isinstance(line, Banner):
            placed += continuity.place(line, 0.0)
    assert not parser.faults
    assert (continuity.lost, continuity.misplaced, continuity.restarts) == (0, 0, 0)
    return banners[0], placed, continuity


def edges_of(placed: list[Placed]) -> np.ndarray:
    return np.array([t for one in placed if isinstance(one.line, EdgeLine) for t in unwrapped_edges(one)])


def test_both_sketches_have_the_same_protocol() -> None:
    first, second = (FIRMWARE / name / "line_protocol.h" for name in SKETCHES)
    assert first.read_bytes() == second.read_bytes()


def test_every_edge_arrives_with_its_time_across_the_wrap(sketches: dict[str, Path]) -> None:
    """830 edges/s for 20 s with jitter, bounces that must be ignored, and micros() wrapping meanwhile."""
    rng = np.random.default_rng(7)
    begin = WRAP - 10_000_000
    times = 300_000.0 + np.cumsum(rng.normal(1_204.8, 3.0, 16_600))
    bounces = times[::50] + rng.uniform(5.0, 190.0, times[::50].size)
    events = [(t, "E ") for t in (*times, *bounces)] + [(1_000.0, "C S"), (5e6, "C Mup.1"), (6e6, "C ?")]
    banner, placed, continuity = parsed(run(sketches["tachometer"], events, 20.6e6, begin))
    assert (banner.protocol, banner.kind, banner.tick_us) == (2, Kind.TACHOMETER, 4)
    assert continuity.wraps == 1
    edges = edges_of(placed)
    assert edges.size == times.size
    assert np.abs(edges - begin - times).max() <= 8.0  # one tick of 4 us, and the wait for a copied ring
    marks = [one for one in placed if isinstance(one.line, MarkLine)]
    assert [one.line.tag for one in marks] == ["up.1"]  # type: ignore[union-attr]
    assert marks[0].ticks - begin == pytest.approx(5e6, abs=10_000)


def test_the_count_of_edges_proves_that_none_is_lost(sketches: dict[str, Path]) -> None:
    """Held up for 0.2 s, the ring of 64 overflows: the heartbeat says how many are lost, the host agrees."""
    times = 300_000.0 + 1_000.0 * np.arange(3_000)
    for hold, lost in ((0.0, False), (200_000.0, True)):
        events = [(t, "E ") for t in times] + [(1_000.0, "C S"), (1.0e6, f"N {hold}")]
        _, placed, _ = parsed(run(sketches["tachometer"], events, 4.0e6))
        count = EdgeCount()
        for one in placed:
            if isinstance(one.line, EdgeLine):
                count.edges(unwrapped_edges(one))
            elif isinstance(one.line, HeartbeatLine):
                count.heartbeat(one.ticks, one.line.total, one.line.overflow)
        assert count.lost == times.size - edges_of(placed).size == count.overflow
        assert (count.lost > 100) is lost


def test_the_heartbeat_goes_on_at_rest_and_nothing_is_sent_before_the_start(
    sketches: dict[str, Path],
) -> None:
    events = [(1e5 + 2_000.0 * i, "E ") for i in range(200)]
    _, placed, _ = parsed(run(sketches["tachometer"], events, 1.05e6))
    assert all(isinstance(one.line, HeartbeatLine) for one in placed)
    assert np.diff([one.ticks for one in placed]) == pytest.approx(100_000, abs=500)
    assert len(placed) == 10


def test_slow_edges_do_not_wait_for_a_full_group(sketches: dict[str, Path]) -> None:
    events = [(3e5 + 40_000.0 * i, "E ") for i in range(20)]
    _, placed, _ = parsed(run(sketches["tachometer"], [(1e3, "C S"), *events], 1.2e6))
    groups = [len(one.line.ticks) for one in placed if isinstance(one.line, EdgeLine)]
    assert sum(groups) == 20
    assert max(groups) <= 2


def test_counts_of_both_signs_pass_through_the_load_cell(sketches: dict[str, Path]) -> None:
    values = [0, 1, -1, 8_388_607, -8_388_608, 123_456, -654_321]
    events = [(1e5 + 100_000.0 * i, f"A {value}") for i, value in enumerate(values)]
    banner, placed, _ = parsed(run(sketches["load_cell"], [(1e3, "C S"), *events], 2.5e6))
    assert banner.kind is Kind.LOAD_CELL
    assert [one.line.raw for one in placed if isinstance(one.line, LoadLine)] == values
    # Then the amplifier falls silent, and the board says so.
    quiet = [one for one in placed if isinstance(one.line, EventLine)]
    assert {one.line.text for one in quiet} == {"hx711 not ready"}  # type: ignore[union-attr]
    assert len(quiet) == 3
    beats = [one.line for one in placed if isinstance(one.line, HeartbeatLine)]
    assert beats[-1].total == len(values)
