"""The calibration of the hinge: the authors' vehicles, the score, the pick, and the verb."""

import json
from pathlib import Path

import numpy as np
import pytest

from onboard.vehicle import known_leg_designs, load_vehicle
from perchhw.cli.main import run
from perchhw.learning.authors_models import authors_vehicle
from perchhw.learning.executor import LocalThreads
from perchhw.learning.grid import Condition
from perchhw.learning.hinge_calibration import (
    Hinge,
    Rates,
    band_differences,
    calibrate,
    hinge_rates,
    score,
)
from perchhw.learning.setup import LearningSetup
from perchhw.learning.sweep import SweepGrid

CONDITIONS = tuple(Condition(v, a) for a in (30.0, 45.0, 60.0, 75.0, 90.0) for v in (1.5, 2.0, 2.5, 3.0))
THEIRS = dict.fromkeys(CONDITIONS, 0.7)


def _rates(level: float, narrow_low: float) -> Rates:
    """All designs at a level; narrow legs at `narrow_low` below 50 deg. Two repeats."""
    rates = {design: np.full((len(CONDITIONS), 2), level) for design in known_leg_designs()}
    low = [condition.angle_deg < 50.0 for condition in CONDITIONS]
    for design in ("narrow-short", "narrow-long"):
        rates[design][low] = narrow_low
    return Rates(CONDITIONS, rates)


def test_authors_vehicle_is_the_one_in_the_library() -> None:
    """Body link and legs put together here, and by hand in crazyflie21-gazebo."""
    ours = authors_vehicle("crazyflie21-upgraded-stored", "semi-narrow-long", 0.08, 6.788e-5)
    theirs = load_vehicle("crazyflie21-gazebo")
    for name in ("mass", "inertia_xx", "inertia_yy", "inertia_zz"):
        assert getattr(ours.body, name).value == pytest.approx(getattr(theirs.body, name).value, rel=2e-3), (
            name
        )
    for name in ("body_half_x", "body_top_z", "body_bottom_z", "propeller_radius", "propeller_height_z"):
        assert getattr(ours.body, name).value == pytest.approx(getattr(theirs.body, name).value, abs=5e-5), (
            name
        )
    assert ours.legs is not None
    assert theirs.legs is not None
    assert ours.legs.hip_z.value == pytest.approx(theirs.legs.hip_z.value, abs=5e-5)
    assert ours.legs.angle_deg.value == 30.0


def test_shorter_and_lighter_legs_change_the_authors_vehicle() -> None:
    short = authors_vehicle("crazyflie21-upgraded-stored", "narrow-short", 0.08, 0.0)
    wide = authors_vehicle("crazyflie21-upgraded-stored", "wide-long", 0.08, 0.0)
    assert short.legs is not None
    assert wide.legs is not None
    assert (short.legs.angle_deg.value, wide.legs.angle_deg.value) == (0.0, 50.0)
    assert short.body.mass.value == pytest.approx(38.24e-3 + 4 * 0.45e-3)
    assert wide.body.inertia_yy.value > short.body.inertia_yy.value


def test_score_rewards_what_the_paper_says_and_the_authors_rates() -> None:
    everything = np.arange(len(CONDITIONS))
    as_said, other = _rates(0.7, 0.4), _rates(0.7, 0.9)
    assert score(as_said, everything, THEIRS).statements > score(other, everything, THEIRS).statements + 5.0
    assert score(as_said, everything, THEIRS).reference == pytest.approx(0.0)
    np.testing.assert_allclose(band_differences(_rates(0.9, 0.9), everything, THEIRS), 0.2)
    # Eight bands, two widths of the discrepancy each.
    assert score(_rates(0.9, 0.9), everything, THEIRS).reference == pytest.approx(-0.5 * 8 * 4.0)


def test_calibration_picks_the_hinge_that_fits() -> None:
    scanned = {Hinge(0.04, 0.0): _rates(0.7, 0.9), Hinge(0.08, 0.0): _rates(0.7, 0.4)}
    found = calibrate(scanned, THEIRS, np.random.default_rng(0), replicates=20)
    assert found.hinges[found.best].stiffness == 0.08
    assert found.interval() == (0.08, 0.08)
    assert found.as_good() == (0.08, 0.08)
    assert found.as_good(within=1e3) == (0.04, 0.08)


@pytest.mark.further
def test_a_softer_hinge_lets_narrow_legs_overswing() -> None:
    """The paper's flexure: at 2.5 to 3.5 m/s and 30 to 40 deg, 0.02 N m/rad lands narrow legs less often."""
    grid = SweepGrid((2.5, 3.0, 3.5), (30.0, 37.5), 2)
    setup = LearningSetup(reward="flown", gains="gazebo", sensing="gazebo")
    soft, stiff = (hinge_rates(setup, Hinge(k, 6.788e-5), grid, LocalThreads(2)) for k in (0.02, 0.2))
    assert stiff.rates["narrow-long"].mean() - soft.rates["narrow-long"].mean() >= 0.2


def test_verb_writes_the_scan(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    reference = tmp_path / "sweep.csv"
    lines = [f"{v},{a},{0.8}" for v in (2.0, 3.0) for a in (37.5, 82.5)]
    reference.write_text("\n".join(["Vel_d,Phi_d,LR_4Leg", *lines]) + "\n", encoding="utf-8")
    arguments = ["learn", "hinge", "--reference", str(reference), "--speeds", "2,3", "--angles", "37.5,82.5"]
    arguments += ["--repeats", "1", "--stiffnesses", "0.04,0.16", "--out", str(tmp_path)]
    assert run(["--json", *arguments]) == 0
    result = json.loads(capsys.readouterr().out)
    assert result == json.loads((tmp_path / "hinge.json").read_text(encoding="utf-8"))
    assert [point["stiffness"] for point in result["scan"]] == [0.04, 0.16]
    assert result["stiffness"]["value"] in (0.04, 0.16)
    assert sum(point["picked"] for point in result["scan"]) == pytest.approx(1.0)
    assert run([*arguments[:-4], "--stiffnesses", "0", "--out", str(tmp_path)]) == 2
