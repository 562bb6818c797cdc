"""One trial again: its history for a plot, and a rollout that a fault report names."""

import json
from pathlib import Path

import numpy as np
import pytest

from perchhw.attempt import STORED_VEHICLE
from perchhw.cli.main import run
from perchhw.learning.errors import LearningInputError
from perchhw.learning.grid import Condition
from perchhw.learning.one_trial import fly_again, learn_one, not_finite_rollouts, run_trial
from perchhw.learning.setup import LearningSetup
from perchhw.learning.sweep import SweepGrid, run_sweep
from sim_backend.physics.rollout import End
from sim_backend.physics.step import is_finite

SETUP = LearningSetup(vehicle=STORED_VEHICLE, seed=7)
CONDITION = Condition(2.5, 50.0)

BLOWS_UP = LearningSetup(randomise=("legs.damping=1e300",))
"""Legs so heavily damped that their moment is beyond float64: the state is not finite once a foot touches."""


def test_a_trial_learned_again_is_that_of_the_sweep(tmp_path: Path) -> None:
    sweep = run_sweep(SETUP, SweepGrid((2.5,), (50.0,), 2), tmp_path)
    trial = learn_one(SETUP, CONDITION, 1)
    row = sweep.rows[1]
    assert (row["mu_tau"], row["landing_rate"]) == (trial["mu"][0], trial["landing_rate"])


def test_the_history_begins_with_the_start_and_converges_to_the_end() -> None:
    trial = learn_one(SETUP, CONDITION, 2)
    n = int(trial["episodes"])
    assert 3 <= n <= 15
    np.testing.assert_allclose(trial["sigma_history"][0], [0.5, 1.5])
    assert trial["mu_history"][0, 0] == pytest.approx(2.4)
    assert trial["sigma"][0] < 0.2 * trial["sigma_history"][0, 0]
    np.testing.assert_allclose(trial["mu_history"][n - 1], trial["mu"], atol=0.5)
    assert np.all(trial["reward_history"][:n] > 0.0)
    assert trial["reward_history"][n - 1] > trial["reward_history"][0]
    assert not np.any(trial["reward_history"][n:])


def test_every_rollout_can_be_flown_again_exactly() -> None:
    parameters, rules = SETUP.load()
    trial = run_trial(parameters, rules, SETUP.seed, CONDITION, 0)
    count = int(trial.record["rollouts"])
    for index in (0, 7, count - 1):  # the first, one of the second episode, one of the evaluation
        flown = fly_again(SETUP, CONDITION, 0, index)
        assert flown.out.tobytes() == trial.bench.outs[index].tobytes()
        assert flown.parameters["mass"] != parameters["mass"]
    assert flown.policy.a_rot == pytest.approx(-1e-3 * trial.record["mu"][1], rel=0.05)
    for index in (-1, count):
        with pytest.raises(LearningInputError, match=f"0 to {count - 1}"):
            fly_again(SETUP, CONDITION, 0, index)


def test_a_rollout_that_is_not_finite_is_reported_and_the_sweep_goes_on(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    options = ["--randomise", BLOWS_UP.randomise[0], "--speeds", "2.5", "--angles", "40,50", "--repeats", "1"]
    assert run(["--json", "learn", "sweep", *options, "--out", str(tmp_path)]) == 0
    said = capsys.readouterr()
    result = json.loads(said.out)
    reports = result["not_finite_rollouts"]
    assert [report["angle_deg"] for report in reports] == [40.0, 50.0]
    assert result["not_finite"] == sum(len(report["rollouts"]) for report in reports)
    assert "'angle_deg': 50.0" in said.err.replace("\n", " ")
    report = reports[1]
    parameters, rules = BLOWS_UP.load()
    trial = run_trial(parameters, rules, report["seed"], CONDITION, report["trial"])
    assert tuple(report["rollouts"]) == not_finite_rollouts(trial.bench.outs[: trial.record["rollouts"]])
    flown = fly_again(BLOWS_UP, CONDITION, report["trial"], report["rollouts"][0])
    assert flown.out["end"] == End.NOT_FINITE
    assert not is_finite(flown.state)
    # It counts as a failure, and the distribution stays finite.
    assert (flown.out["feet"], trial.record["landing_rate"]) == (0, 0.0)
    assert np.all(np.isfinite([*trial.record["mu"], *trial.record["sigma"], trial.record["reward"]]))
    run_again = run(["--json", "learn", "sweep", *options, "--out", str(tmp_path), "--resume"])
    assert run_again == 0
    assert json.loads(capsys.readouterr().out)["not_finite_rollouts"] == reports
