"""The scale's counts."""

import numpy as np
import pytest

from sim_backend.bench.faults import BenchFaults
from sim_backend.bench.scale import LIMIT, ScaleBoard, SimulatedLoadCell


def counts(load: float, seconds: float = 2.0, thrust: float = 0.0, **faults: object) -> np.ndarray:
    """Conversions under a load and a thrust (g)."""
    cell = SimulatedLoadCell(np.random.default_rng(4), BenchFaults(**faults))  # type: ignore[arg-type]
    found = [cell.step(tick / 1000, load, thrust) for tick in range(1, round(seconds * 1000) + 1)]
    return np.array([value for value in found if value is not None])


def test_counts_are_a_line_in_the_load_with_the_noise_of_a_good_cell() -> None:
    low, high = counts(0.0), counts(50.0)
    slope = (high.mean() - low.mean()) / 50.0
    cell = SimulatedLoadCell(np.random.default_rng(4), BenchFaults())
    assert slope == pytest.approx(cell.counts_per_gram, rel=1e-3)
    assert low.std() / slope == pytest.approx(0.006, rel=0.3)
    assert abs(cell.zero) > 1000.0
    others = {
        SimulatedLoadCell(np.random.default_rng(seed), BenchFaults()).counts_per_gram for seed in range(5)
    }
    assert len(others) == 5


@pytest.mark.parametrize("rate", [10, 80])
def test_conversions_a_second(rate: int) -> None:
    assert len(counts(0.0, scale_rate=rate)) == pytest.approx(2 * rate, abs=1)


def test_a_step_needs_four_conversions() -> None:
    cell = SimulatedLoadCell(np.random.default_rng(4), BenchFaults(drift=0.0))
    found = []
    for tick in range(1, 2001):
        value = cell.step(tick / 1000, 0.0 if tick <= 1000 else 100.0, 0.0)
        if value is not None:
            found.append((value - cell.zero) / cell.counts_per_gram)
    first = next(i for i, grams in enumerate(found) if grams > 1.0)
    assert found[first : first + 5] == pytest.approx([25.0, 50.0, 75.0, 100.0, 100.0], abs=0.1)


def test_thrust_pushes_unless_the_rig_is_inverted() -> None:
    rest = counts(80.0).mean()
    assert counts(80.0, thrust=20.0).mean() > rest + 70_000
    assert counts(80.0, thrust=20.0, inverted=True).mean() < rest - 70_000


def test_zero_drifts_while_it_warms_up() -> None:
    def drift(grams: float) -> float:
        found = counts(0.0, seconds=600.0, drift=grams)
        return float((found[-400:].mean() - found[:400].mean()) / 4200.0)

    assert drift(5.0) - drift(0.0) == pytest.approx(5.0 * (1 - np.exp(-1.5)), rel=0.12)


def test_stuck_saturated_and_off() -> None:
    stuck = counts(1.0, scale_stuck_at=1.0)
    assert len(set(stuck[-70:])) == 1
    assert len(set(stuck[:70])) > 30
    assert set(counts(1.0, scale_saturated_at=1.0)[-70:]) == {LIMIT}
    assert len(counts(1.0, scale_off_at=1.0)) == pytest.approx(80, abs=1)


def test_overload_saturates() -> None:
    assert set(counts(1e5)) == {LIMIT}
    assert set(counts(-1e5)) == {-LIMIT - 1}


def test_board_passes_conversions_on_and_misses_them() -> None:
    board = ScaleBoard(np.random.default_rng(1), BenchFaults(resonator=0.0))
    board.receive(b"S", 0.0)
    board.conversion(-1234)
    board.step(0.012)
    for tick in range(13, 600):
        board.conversion(None)
        board.step(tick / 1000)
    letters = [text for text in board.wire.take(1.0).split(b"\n") if text[:1] in (b"L", b"X")]
    assert letters[0].startswith(b"L,0,12000,-1234*")
    assert letters[1].split(b"*")[0].split(b",", 2)[2].endswith(b",1,hx711 not ready")
