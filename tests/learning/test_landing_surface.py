"""Pairs from attempts at random: they find a best trigger and moment that are hidden in the outcomes."""

import dataclasses
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from onboard.arrays import FloatArray
from perchhw.cli.main import run
from perchhw.learning.executor import LocalThreads
from perchhw.learning.landing_surface import EARLIEST, LATEST, SurfaceSettings, surface_pairs
from perchhw.learning.random_attempts import MOMENTS, TAUS, fly_at_random
from perchhw.learning.setup import MEASURED, LearningSetup
from perchhw.learning.trigger_policy import TrainingError
from sim_backend.physics.rollout import ROLLOUT

WORLD = LearningSetup(sensing=MEASURED, domain="none", seed=4)


def best_tau(v_z: FloatArray) -> FloatArray:
    """The threshold (s) of the hidden law for a climb (m/s)."""
    return 0.2 + 0.03 * (v_z - 2.0)


def hidden() -> Any:
    """Attempts that hold cleanly within 20 ms of the best tau and 1.5 N mm of 5; early ones with contact."""
    rng = np.random.default_rng(3)
    outs = np.zeros(20_000, ROLLOUT)
    v_x, v_z = rng.uniform(0.5, 2.5, len(outs)), rng.uniform(1.0, 3.0, len(outs))
    outs["tau"], outs["a_rot"] = rng.uniform(*TAUS, len(outs)), rng.uniform(*MOMENTS, len(outs))
    outs["d_ceil"] = v_z * outs["tau"]
    outs["theta_x"] = v_x / outs["d_ceil"]
    chance = rng.random(len(outs))
    clean = (np.abs(outs["tau"] - best_tau(v_z)) < 0.02) & (np.abs(outs["a_rot"] + 5e-3) < 1.5e-3)
    outs["feet"] = np.where(clean & (chance < 0.6), 4, 2)
    touched = outs["tau"] > 0.29
    outs["feet"][touched & (chance < 0.9)] = 4
    outs["body_contact"][touched] = 1
    return outs


def test_the_pairs_lie_where_most_attempts_hold() -> None:
    """Landings with contact count a third: 0.9 of them are worth less than 0.6 clean ones."""
    found = surface_pairs(hidden(), seed=0, settings=SurfaceSettings(steps=600, climbs=500))
    tau, _, d_ceil = found.pairs.states.T
    late = tau - best_tau(d_ceil / tau)
    assert late.mean() == pytest.approx(0.5 * (EARLIEST + LATEST), abs=6e-3)
    near = np.abs(late) < 0.01
    assert found.pairs.a_rot[near].mean() == pytest.approx(-5e-3, abs=0.5e-3)
    assert found.log_loss < found.base_log_loss - 0.02


def test_few_attempts_are_refused() -> None:
    with pytest.raises(TrainingError, match="1999 attempts that triggered: fly more"):
        surface_pairs(hidden()[:1999], seed=0)


def test_attempts_at_random_are_the_same_for_any_number_of_workers() -> None:
    ranges = (2.0, 3.0), (40.0, 50.0)
    one, two = (fly_at_random(WORLD, *ranges, 60, executor=LocalThreads(n)) for n in (1, 2))
    assert np.array_equal(one, two)
    other = fly_at_random(dataclasses.replace(WORLD, seed=5), *ranges, 60)
    assert not np.array_equal(one["tau"], other["tau"])
    assert one["speed"].min() >= 2.0
    assert one["speed"].max() <= 3.0
    assert np.ptp(one["a_rot"]) > 0.5 * (MOMENTS[1] - MOMENTS[0])


def test_too_few_attempts_are_refused_before_they_are_flown(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "surface"
    assert run(["learn", "surface", "--attempts", "1999", "--out", str(out)]) == 2
    assert "--attempts 1999: a surface needs at least 2000" in capsys.readouterr().err
    assert not out.exists()


@pytest.mark.parametrize("name", ["pairs.csv", "policy.policy.json", "validation.json"])
def test_results_of_another_run_are_left_alone(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], name: str
) -> None:
    (tmp_path / name).write_text("another's")
    assert run(["learn", "surface", "--out", str(tmp_path)]) == 2
    assert f"already holds results ({name}): choose another --out" in capsys.readouterr().err
    assert [path.name for path in tmp_path.iterdir()] == [name]
    assert (tmp_path / name).read_text() == "another's"
