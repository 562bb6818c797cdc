"""Lost lines, wraps and restarts, told from sequence numbers and ticks alone."""

from collections.abc import Iterable

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from calibration.bench.instruments.continuity import Continuity, Placed
from calibration.bench.instruments.protocol import Banner, HeartbeatLine, Kind

WRAP = 1 << 32
BANNER = Banner(1, Kind.TACHOMETER, "1", "u", 4)


def beats(start_seq: int, start_us: int, count: int) -> list[HeartbeatLine]:
    """Heartbeats as a device sends them, numbers and ticks wrapping."""
    return [
        HeartbeatLine((start_seq + i) % 65536, (start_us + 100_000 * i) % WRAP, 0, 0, 1) for i in range(count)
    ]


def run(continuity: Continuity, lines: Iterable[HeartbeatLine | Banner]) -> list[Placed]:
    placed = []
    for line in lines:
        if isinstance(line, Banner):
            continuity.banner(line)
        else:
            placed += continuity.place(line, 0.0)
    return placed + continuity.finish()


@given(st.integers(0, 65535), st.integers(0, WRAP - 1), st.sets(st.integers(1, 198), max_size=60))
def test_missing_lines_are_counted_exactly_and_the_clock_goes_on(
    seq: int, start: int, missing: set[int]
) -> None:
    lines = beats(seq, start, 200)
    continuity = Continuity()
    placed = run(continuity, [line for i, line in enumerate(lines) if i not in missing])
    assert continuity.lost == len(missing)
    assert sum(one.lost for one in placed) == len(missing)
    assert (continuity.restarts, continuity.misplaced) == (0, 0)
    true = [start + 100_000 * i for i in range(200) if i not in missing]
    assert [one.ticks for one in placed] == true
    assert continuity.wraps == true[-1] // WRAP


def test_three_hours_of_one_line_a_tenth_of_a_second_wrap_twice() -> None:
    continuity = Continuity()
    placed = run(continuity, beats(0, 0, 3 * 36_000))
    assert (continuity.wraps, continuity.lost, continuity.restarts) == (2, 0, 0)
    assert placed[-1].ticks == 100_000 * (3 * 36_000 - 1)


@pytest.mark.parametrize("with_banner", [True, False])
@pytest.mark.parametrize("before_us", [300_000, WRAP - 300_000, WRAP // 2])
@pytest.mark.parametrize("count", [4, 400])
def test_a_restart_is_told_from_a_wrap(with_banner: bool, before_us: int, count: int) -> None:
    continuity = Continuity()
    banner = [BANNER] if with_banner else []
    placed = run(continuity, [*beats(60_000, before_us, count), *banner, *beats(0, 2_000, 3)])
    assert (continuity.restarts, continuity.lost, continuity.misplaced) == (1, 0, 0)
    assert [one.epoch for one in placed] == [0] * count + [1] * 3
    assert [one.ticks for one in placed[count:]] == [2_000, 102_000, 202_000]


def test_first_lines_after_a_restart_that_are_missing_are_lost_lines() -> None:
    continuity = Continuity()
    run(continuity, [*beats(100, 10_000_000, 5), BANNER, *beats(0, 2_000, 9)[3:]])
    assert (continuity.restarts, continuity.lost) == (1, 3)


def test_a_banner_that_was_asked_for_is_no_restart() -> None:
    continuity = Continuity()
    lines = beats(0, 0, 10)
    placed = run(continuity, [*lines[:5], BANNER, *lines[5:]])
    assert (continuity.restarts, continuity.lost, len(placed)) == (0, 0, 10)


@pytest.mark.parametrize("wrong_seq", [3, 40, 30_000, 65_000])
@pytest.mark.parametrize("wrong_tick", [None, 77, 3_000_000_000])
def test_one_wrong_number_with_a_right_checksum_moves_nothing(wrong_seq: int, wrong_tick: int | None) -> None:
    lines = beats(0, 1_000_000, 20)
    tick = lines[10].tick if wrong_tick is None else wrong_tick
    lines[10] = HeartbeatLine(wrong_seq, tick, 0, 0, 1)
    continuity = Continuity()
    placed = run(continuity, lines)
    assert (continuity.restarts, continuity.misplaced, continuity.lost) == (0, 1, 1)
    assert [one.ticks for one in placed] == [1_000_000 + 100_000 * i for i in range(20) if i != 10]


@given(st.integers(0, 2**32 - 1))
def test_any_mixture_of_numbers_is_survived(seed: int) -> None:
    rng = np.random.default_rng(seed)
    continuity = Continuity()
    lines = [HeartbeatLine(int(rng.integers(65536)), int(rng.integers(WRAP)), 0, 0, 1) for _ in range(30)]
    placed = run(continuity, lines)
    assert len(placed) + continuity.misplaced == 30


def test_a_device_that_says_nothing_for_half_an_hour_goes_on() -> None:
    first, second = beats(0, 0, 5), beats(5, 1_800_000_000, 5)
    continuity = Continuity()
    placed = run(continuity, [*first, *second])
    assert (continuity.restarts, continuity.lost, continuity.misplaced) == (0, 0, 0)
    assert [one.ticks for one in placed[5:]] == [line.tick for line in second]
