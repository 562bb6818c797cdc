"""Agreement of maps of landing rates, and ours with the authors' randomised sweep."""

import json
from pathlib import Path

import numpy as np
import pytest

from perchhw.attempt import STORED_VEHICLE
from perchhw.cli.main import run
from perchhw.learning.agreement import agreement, median_of_best
from perchhw.learning.bands import best_per_condition
from perchhw.learning.errors import LearningInputError
from perchhw.learning.grid import Condition
from perchhw.learning.results import read_reference
from perchhw.learning.setup import LearningSetup
from perchhw.learning.sweep import SweepGrid, run_sweep
from perchhw.learning.sweep_folder import Row

GAZEBO = LearningSetup(vehicle="crazyflie21-gazebo", reward="flown", sensing="gazebo", gains="gazebo")
COARSE = SweepGrid((1.5, 2.0, 2.5, 3.0, 3.5), (30.0, 45.0, 60.0, 75.0, 90.0), 3)


def test_two_maps_by_hand() -> None:
    a = {Condition(v, 45.0): rate for v, rate in ((1.5, 0.0), (2.0, 0.4), (2.5, 0.5), (3.0, 1.0))}
    b = {Condition(v, 45.0): rate for v, rate in ((1.5, 0.1), (2.0, 0.6), (2.5, 0.5), (3.0, 0.9), (3.5, 1.0))}
    found = agreement(a, b)
    # Ranks 1 2 3 4 against 1 3 2 4: 1 - 6 * 2 / (4 * 15).
    assert found[:4] == pytest.approx((0.8, 0.1, 4, -0.05))
    # Neighbours 0.5 m/s apart hardly mix; a map that is one number higher everywhere has the same ranks.
    assert found.smoothed_spearman == pytest.approx(0.8)
    higher = agreement({condition: rate + 0.1 for condition, rate in b.items()}, b)
    assert higher.bias == pytest.approx(0.1)
    assert higher.smoothed_spearman == pytest.approx(1.0)


def test_too_little_in_common_is_refused() -> None:
    with pytest.raises(LearningInputError, match="0 conditions in common"):
        agreement({Condition(1.0, 45.0): 0.5}, {Condition(2.0, 45.0): 0.5})


def test_median_over_groups_of_three() -> None:
    rates = [0.1, 0.9, 0.2, 0.3, 0.4, 0.5, 0.7, 0.6, 0.0, 1.0]
    rows: list[Row] = [
        {"speed_m_s": 2.0, "angle_deg": 45.0, "trial": k, "landing_rate": r} for k, r in enumerate(rates)
    ]
    assert median_of_best(rows) == {Condition(2.0, 45.0): 0.7}
    with pytest.raises(LearningInputError, match="fewer than 3 repeats"):
        median_of_best(rows[:2])


def test_the_authors_two_sweeps_agree_as_little_as_the_documentation_says(shared_data: Path) -> None:
    sweeps = shared_data / "habas2022" / "sweeps"
    randomised = read_reference(sweeps / "NL_LR_Trials.csv").rates
    plain = read_reference(sweeps / "NL_LR_Trials_NDR.csv").rates
    grid = {c: rate for c, rate in randomised.items() if c.speed < 3.51}
    assert agreement(grid, plain)[:3] == pytest.approx((0.593, 0.187, 357), abs=1e-3)


def test_a_design_against_a_table(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A sweep against itself agrees without a difference, and the settings are those of the authors."""
    grid = ["--speeds", "2,3", "--angles", "45,60", "--repeats", "3", "--legs", "semi-narrow-long"]
    table = tmp_path / "theirs.csv"
    rates = {(2.0, 45.0): 0.1, (2.0, 60.0): 0.4, (3.0, 45.0): 0.9, (3.0, 60.0): 0.8}
    lines = [f"{speed},{angle},{rate}" for (speed, angle), rate in rates.items()]
    table.write_text("\n".join(["speed_m_s,angle_deg,landing_rate", *lines]))
    folder = tmp_path / "sweep"
    asked = ["--json", "learn", "agreement", "--out", str(folder), *grid]
    assert run([*asked, "--reference", str(table)]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["settings"]["vehicle"] == "crazyflie21-gazebo"
    assert {found["settings"][name] for name in ("sensing", "gains")} == {"gazebo"}
    assert found["settings"]["reward"] == "flown"
    assert found["median_of_sweeps"]["conditions"] == 4
    assert json.loads((folder / "agreement.json").read_text()) == found
    assert run([*asked, "--resume", "--reference", str(folder / "pairs.csv")]) == 0
    itself = json.loads(capsys.readouterr().out)["median_of_sweeps"]
    assert itself["mean_difference"] == itself["bias"] == 0.0


def test_their_simulation_stands_for_their_sweep(shared_data: Path, tmp_path: Path) -> None:
    theirs = read_reference(shared_data / "habas2022" / "sweeps" / "NL_LR_Trials.csv").rates
    ours = best_per_condition(run_sweep(GAZEBO, COARSE, tmp_path / "gazebo").rows)
    paper = best_per_condition(
        run_sweep(
            LearningSetup(vehicle=STORED_VEHICLE, sensing="perfect"),
            COARSE,
            tmp_path / "paper",
        ).rows
    )
    close, far = agreement(ours, theirs), agreement(paper, theirs)
    # One sweep of theirs against another is 0.17 to 0.19 apart; 25 conditions leave a standard error of 0.03.
    assert close.conditions == 25
    assert close.mean_difference < 0.26
    assert close.spearman > far.spearman + 0.1
    means = [np.mean(list(rates.values())) for rates in (ours, paper)]
    level = np.mean([theirs[condition] for condition in ours])
    assert abs(means[0] - level) < 0.1 < means[1] - level
