"""The leg study: files, factors of landings that were flown, reproducibility, bad input, and the verb."""

import csv
import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from onboard.vehicle import known_leg_designs
from perchhw.cli.main import run
from perchhw.learning.errors import LearningInputError
from perchhw.learning.executor import LocalThreads
from perchhw.learning.leg_landings import COLUMNS, FACTOR_COLUMNS
from perchhw.learning.leg_results import SCHEMA
from perchhw.learning.leg_study import run_leg_study
from perchhw.learning.leg_trends import Pairs, trends
from perchhw.learning.setup import LearningSetup
from perchhw.learning.sweep import SweepGrid

GRID = SweepGrid(speeds=(2.0, 3.0), angles_deg=(37.5, 75.0), repeats=2)
SETUP = LearningSetup(vehicle="crazyflie21-upgraded-stored", seed=5)


def _landings(folder: Path) -> list[dict[str, str]]:
    with (folder / "landings.csv").open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


@pytest.fixture(scope="module")
def study(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two designs on four conditions."""
    folder = tmp_path_factory.mktemp("legs")
    run_leg_study(SETUP, ("narrow-long", "wide-short"), GRID, folder, rollouts=5, executor=LocalThreads(2))
    return folder


@pytest.mark.further
def test_every_landing_has_its_row(study: Path) -> None:
    rows = _landings(study)
    assert tuple(rows[0]) == COLUMNS
    assert len(rows) == 2 * len(list(GRID.keys())) * 5
    assert [row["design"] for row in rows] == ["narrow-long"] * 40 + ["wide-short"] * 40
    for row in rows:
        touched = bool(row["impact_time"])
        assert all(bool(row[name]) == touched for name in FACTOR_COLUMNS if name != "sufficiency")


@pytest.mark.further
def test_factors_agree_with_what_the_landing_did(study: Path) -> None:
    """A foot that touches first is inside the window, and clean landings are."""
    landed = [row for row in _landings(study) if row["tilt_deg"]]
    assert len(landed) > 60
    for row in landed:
        margin = float(row["tilt_deg"]) - float(row["window_low_deg"])
        assert float(row["window_margin_deg"]) == pytest.approx(margin)
        assert (row["foot_first"] == "1") == (margin >= 0.0)
        assert float(row["energy_surplus"]) == pytest.approx(
            float(row["swing_energy"]) + float(row["gravity_energy"])
        )
        if row["outcome"] == "four_leg":
            assert margin >= 0.0


@pytest.mark.further
def test_study_document_has_rates_medians_and_trends(study: Path) -> None:
    document = json.loads((study / "study.json").read_text(encoding="utf-8"))
    assert document["schema"] == "perchhw.leg_study/1"
    assert document["settings"]["legs"] == ["narrow-long", "wide-short"]
    design = document["designs"]["wide-short"]
    rows = [row for row in _landings(study) if row["design"] == "wide-short"]
    assert design["all"]["trials"] == 8
    assert design["impact_window_deg"] == [pytest.approx(97.0, abs=0.1), 180.0]
    band = next(b for b in design["bands"] if b["angles_deg"] == [30.0, 50.0] and b["speeds_m_s"][1] is None)
    good = [
        float(row["swing_energy"])
        for row in rows
        if row["outcome"] == "four_leg" and row["angle_deg"] == "37.5" and row["speed_m_s"] == "3.0"
    ]
    assert band["successes"]["landings"] == len(good) > 0
    assert band["successes"]["medians"]["swing_energy"] == pytest.approx(np.median(good))
    assert set(document["trends"]) >= {"speed", "narrow"}


@pytest.mark.further
def test_study_does_not_depend_on_workers_and_resumes(study: Path, tmp_path: Path) -> None:
    designs = ("narrow-long", "wide-short")
    run_leg_study(SETUP, designs[:1], GRID, tmp_path, rollouts=5, executor=LocalThreads(1))
    with pytest.raises(LearningInputError, match="--resume"):
        run_leg_study(SETUP, designs, GRID, tmp_path, rollouts=5)
    run_leg_study(SETUP, designs, GRID, tmp_path, rollouts=5, executor=LocalThreads(1), resume=True)
    for name in ("landings.csv", "study.json", "wide-short/pairs.csv"):
        assert (tmp_path / name).read_bytes() == (study / name).read_bytes(), name


def test_a_study_is_not_gone_on_with_without_designs_that_it_has(tmp_path: Path) -> None:
    """They would be gone from its landings, its numbers and its page."""
    before = {"schema": SCHEMA, "designs": {"narrow-long": {}, "wide-long": {}}}
    (tmp_path / "study.json").write_text(json.dumps(before))
    with pytest.raises(LearningInputError, match=r"a study of wide-long too: name all .* --out"):
        run_leg_study(SETUP, ("narrow-long", "wide-short"), GRID, tmp_path, resume=True)
    assert json.loads((tmp_path / "study.json").read_text()) == before


def test_what_cannot_be_studied_is_refused(tmp_path: Path) -> None:
    for designs, rollouts in (
        (("spider",), 5),
        ((), 5),
        (("wide-long", "wide-long"), 5),
        (("wide-long",), 0),
    ):
        with pytest.raises(LearningInputError):
            run_leg_study(SETUP, designs, GRID, tmp_path / "none", rollouts=rollouts)
    with pytest.raises(LearningInputError, match="whole designs"):
        run_leg_study(LearningSetup(leg_angle_deg=20.0), ("wide-long",), GRID, tmp_path / "none")
    assert not (tmp_path / "none").exists()


@pytest.mark.further  # tests/report studies two designs
def test_verb_writes_the_study(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    arguments = ["learn", "legs", "--speeds", "2.5", "--angles", "45", "--repeats", "1", "--rollouts", "2"]
    assert run(["--json", *arguments, "--out", str(tmp_path)]) == 0
    result = json.loads(capsys.readouterr().out)
    assert tuple(result["designs"]) == known_leg_designs()
    assert Path(result["landings"]).is_file()
    assert run([*arguments, "--resume", "--out", str(tmp_path)]) == 0
    assert "wide-short" in capsys.readouterr().out
    assert run([*arguments, "--designs", "spider", "--out", str(tmp_path)]) == 2


def _pairs(rate: Any) -> Pairs:
    """Trials on a grid with a landing rate by speed and angle; the moment falls with tau."""
    speed, angle = (a.ravel() for a in np.meshgrid([1.5, 2.0, 2.5, 3.0], [30.0, 45.0, 60.0, 75.0, 90.0]))
    tau = 0.2 + 0.01 * speed + 1e-4 * angle
    return Pairs(speed, angle, np.array([rate(v, a) for v, a in zip(speed, angle, strict=True)]), tau, -tau)


def test_trends_are_the_differences_they_say() -> None:
    """Rates made up so that each number can be read off."""
    designs = {
        "semi-narrow-long": _pairs(lambda v, a: 0.9 if a < 65 else 0.5),
        "semi-narrow-short": _pairs(lambda v, a: 0.4 if v < 2.5 else 0.6),
        "narrow-long": _pairs(lambda v, a: 0.3 if a < 50 else 0.7),
        "wide-long": _pairs(lambda v, a: 0.2 if 40 < a < 80 else 0.6),
    }
    numbers = {name: trend.numbers for name, trend in trends(designs).items()}
    assert numbers["speed"]["semi-narrow-short"] == pytest.approx(0.2)
    assert numbers["speed"]["narrow-long"] == pytest.approx(0.0)
    assert numbers["semi_narrow"]["semi-narrow-long, 30-65 less 65-90 deg"] == pytest.approx(0.4)
    best_other = (0.3 + 0.3 + 0.7) / 3
    assert numbers["semi_narrow"]["semi-narrow-long less the best other at 30-65 deg"] == pytest.approx(
        0.9 - max(best_other, 0.5)
    )
    assert numbers["narrow"]["narrow-long, 50-90 less 30-50 deg"] == pytest.approx(0.4)
    assert numbers["narrow"]["narrow-long less semi-narrow-long at 65-90 deg"] == pytest.approx(0.2)
    assert numbers["wide"]["wide-long, ends less 45-80 deg"] == pytest.approx(0.4)
    assert numbers["length"] == {"semi-narrow": pytest.approx(0.74 - 0.5)}
    assert numbers["moment"] == {"semi-narrow-long": pytest.approx(1.0)}
    assert all(math.isfinite(value) for found in numbers.values() for value in found.values())
