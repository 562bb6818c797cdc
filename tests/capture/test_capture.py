"""`calibrate capture`: pads whose truth was drawn, drops that say little, tables that cannot be used."""

import json
from pathlib import Path

import numpy as np
import pytest

from calibration.bench.capture.advice import BATCH, next_drops
from calibration.bench.capture.checks import check_fit
from calibration.bench.capture.drops import Drops, fall_height, read_drops
from calibration.bench.capture.errors import DropTableError
from calibration.bench.capture.fit import fit_drops
from onboard.vehicle import load_vehicle
from perchhw.cli.main import run

SPEEDS = np.array([0.2, 0.4, 0.6, 0.8, 1.1, 1.5])


def drawn(rng: np.random.Generator, speed: float, spread: float, at: np.ndarray, each: int) -> Drops:
    """Each drop against a limit of its own, as the simulation draws them."""
    limits = speed + spread * rng.standard_normal((at.size, each))
    stuck = (at[:, None] >= limits).sum(axis=1)
    return Drops.of("drawn", at, np.full(at.size, each), stuck)


def coverage(sets: int, each: int, seed: int) -> np.ndarray:
    """(speed, spread, rejected) shares of sets whose interval holds the truth, or that were rejected."""
    rng = np.random.default_rng(seed)
    held = np.zeros(3)
    for _ in range(sets):
        speed, spread = rng.uniform(0.3, 1.1), rng.uniform(0.05, 0.5)
        fit = fit_drops(drawn(rng, speed, spread, SPEEDS, each))
        held += [
            fit.speed_interval[0] <= speed <= fit.speed_interval[1],
            fit.spread_interval[0] <= spread <= fit.spread_interval[1],
            any(one.severity.value == "reject" for one in check_fit(fit)),
        ]
    return held / sets


def test_intervals_hold_the_truth() -> None:
    speed, spread, rejected = coverage(60, 20, 1)
    assert speed >= 0.88
    assert spread >= 0.88
    assert rejected == 0.0


@pytest.mark.soak
@pytest.mark.parametrize("each", [3, 5, 20, 100])
def test_intervals_hold_the_truth_in_95_of_100(each: int) -> None:
    speed, spread, rejected = coverage(1000, each, each)
    wanted = 0.89 if each < 5 else 0.925  # with three drops a speed limits are too narrow
    assert speed >= wanted
    assert spread >= wanted
    assert rejected < (0.2 if each < 20 else 0.005)


def test_many_drops_give_the_truth() -> None:
    fit = fit_drops(drawn(np.random.default_rng(0), 0.7, 0.3, SPEEDS, 20_000))
    assert fit.speed == pytest.approx(0.7, abs=0.01)
    assert fit.spread == pytest.approx(0.3, abs=0.01)
    assert check_fit(fit) == []


def test_separated_drops_give_the_gap_and_a_spread_that_is_only_bounded() -> None:
    fit = fit_drops(Drops.of("t", np.array([0.2, 0.4, 0.8, 1.0]), np.full(4, 10), np.array([0, 0, 10, 10])))
    assert fit.drops.separated
    assert fit.speed == pytest.approx(0.6)
    assert fit.speed_interval == pytest.approx((0.4, 0.8), abs=0.02)
    assert fit.spread_interval[0] == fit.spread == 0.0
    assert 0.05 < fit.spread_interval[1] < 0.6
    assert "separated" in [one.code for one in check_fit(fit)]
    inside = [v for v in next_drops(fit).speeds if 0.4 <= v <= 0.8]
    assert inside, "the gap is where drops tell most"


@pytest.mark.parametrize(
    ("thrown", "stuck", "code"),
    [
        ((5, 5, 5), (5, 5, 5), "all_stuck"),
        ((5, 5, 5), (0, 0, 0), "none_stuck"),
        ((8, 8, 8), (6, 4, 2), "no_rise"),
        ((2, 1, 2), (1, 0, 1), "no_rise"),
    ],
)
def test_drops_that_do_not_show_a_limit_are_rejected(
    thrown: tuple[int, ...], stuck: tuple[int, ...], code: str
) -> None:
    fit = fit_drops(Drops.of("t", np.array([0.3, 0.6, 0.9]), np.array(thrown), np.array(stuck)))
    assert code in [one.code for one in check_fit(fit) if one.severity.value == "reject"]


def test_a_pad_that_tires_is_a_misfit() -> None:
    """Half as many at 0.8 m/s as at its neighbours: no curve that rises goes there."""
    stuck = np.array([2, 12, 38, 16, 38, 40])
    fit = fit_drops(Drops.of("t", SPEEDS, np.full(6, 40), stuck))
    assert "misfit" in [one.code for one in check_fit(fit)]


def test_advised_drops_narrow_the_speed_more_than_the_same_ones_again() -> None:
    rng = np.random.default_rng(2)
    coarse = np.array([0.2, 1.5, 2.8])
    advised: list[float] = []
    same: list[float] = []
    for _ in range(10):
        first = drawn(rng, 0.9, 0.2, coarse, 10)
        advice = next_drops(fit_drops(first))
        for at, widths in ((np.array(advice.speeds), advised), (coarse, same)):
            more = drawn(rng, 0.9, 0.2, at, BATCH)
            columns = (np.concatenate(pair) for pair in zip(_columns(first), _columns(more), strict=True))
            low, high = fit_drops(Drops.of("both", *columns)).speed_interval
            widths.append(high - low)
    assert np.median(advised) < 0.6 * np.median(same)


def _columns(drops: Drops) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    return drops.speed, drops.thrown, drops.stuck


def test_heights_and_single_drops_are_the_same_as_counts_by_speed(tmp_path: Path) -> None:
    height = fall_height(0.8)
    assert height == pytest.approx(0.0326, abs=1e-4)
    (tmp_path / "one.csv").write_text(f"height_m,stuck\n{height!r},yes\n{height!r},No\n{height!r},1\n")
    (tmp_path / "many.csv").write_text("# of a pad\nspeed_m_s,thrown,stuck\n0.8,3,2\n")
    for name in ("one.csv", "many.csv"):
        drops = read_drops(tmp_path / name)
        assert drops.rows() == [{"speed_m_s": pytest.approx(0.8), "thrown": 3, "stuck": 2}]


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("speed_m_s,stuck\n", "no drops below the header"),
        ("v,stuck\n1,yes\n", "one column 'speed_m_s' or 'height_m' is needed"),
        ("speed_m_s,stuck\n0.5,perhaps\n", "row 2 column 'stuck': 'perhaps' is neither yes nor no"),
        ("speed_m_s,stuck\n0.5,7\n", "counts need a column 'thrown'"),
        ("speed_m_s,thrown,stuck\n0.5,3,4\n", "row 2 column 'stuck': '4'"),
        ("speed_m_s,thrown,stuck\n0.5,0,0\n", "row 2 column 'thrown': '0'"),
        ("speed_m_s,stuck\n-0.5,yes\n", "row 2 column 'speed_m_s': -0.5"),
        ("speed_m_s,stuck\n500,yes\n", "is it in SI units"),
        ("speed_m_s,stuck\nnan,yes\n", "not a finite number"),
    ],
)
def test_tables_that_cannot_be_used_name_the_place(text: str, said: str, tmp_path: Path) -> None:
    (tmp_path / "drops.csv").write_text(text)
    with pytest.raises(DropTableError, match=said):
        read_drops(tmp_path / "drops.csv")


def test_the_command_measures_and_apply_writes_the_effect(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    table, folder, file = tmp_path / "drops.csv", tmp_path / "run", tmp_path / "mine.toml"
    table.write_text("speed_m_s,thrown,stuck\n0.2,20,1\n0.4,20,4\n0.7,20,13\n1.0,20,18\n1.4,20,20\n")
    assert run(["--json", "calibrate", "capture", "--from-table", str(table), "--out", str(folder)]) == 0
    said = json.loads(capsys.readouterr().out)
    found = said["vehicle"]["effects"]["pad_capture"]
    assert 0.45 < found["speed"]["value"] < 0.75
    assert len(said["next"]) == 3
    assert (folder / "raw" / "drops-1.csv").read_text() == table.read_text()
    assert "<svg" in Path(said["report"]).read_text(encoding="utf-8")
    applied = ["calibrate", "apply", str(folder), "--vehicle", "crazyflie21-upgraded", "--out", str(file)]
    assert run([*applied, "--yes"]) == 0
    effects = {one.name: one.parameters for one in load_vehicle(str(file)).effects}
    assert effects["pad_capture"]["speed"].value == found["speed"]["value"]
    assert effects["pad_capture"]["spread"].sigma == pytest.approx(found["spread"]["sigma"])


def test_a_limit_that_was_not_seen_is_not_applied(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    table, folder, file = tmp_path / "drops.csv", tmp_path / "run", tmp_path / "mine.toml"
    table.write_text("speed_m_s,stuck\n0.5,yes\n0.7,yes\n0.9,yes\n")
    assert run(["calibrate", "capture", "--from-table", str(table), "--out", str(folder)]) == 0
    assert "drop slower" in capsys.readouterr().out
    applied = ["calibrate", "apply", str(folder), "--vehicle", "crazyflie21-upgraded", "--out", str(file)]
    assert run([*applied, "--yes"]) == 2
    assert not file.exists()
