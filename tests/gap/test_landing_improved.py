"""The vehicle that a search writes, and the document beside it: what is to be expected of which vehicle."""

import json
from itertools import product
from pathlib import Path
from typing import Any

import pytest

from calibration.gap.landings.outcomes.expectation import ModelErrorFileError
from calibration.gap.landings.outcomes.search import LEAST_NAMING
from calibration.gap.landings.outcomes.vehicles import HINGES, Point
from calibration.gap.landings.outcomes.verdict import found_in_landings
from onboard.vehicle import load_vehicle
from perchhw.cli.main import run
from perchhw.learning.real_rate import known_error
from perchhw.learning.setup import LearningSetup
from tests.truth.landings.drone import Drone
from tests.truth.landings.judge import HINGES as DAMPED
from tests.truth.landings.judge import VEHICLE
from tests.truth.landings.outcomes import write_outcomes

POINTS = [Point(*hinge, *pad) for hinge, pad in product(HINGES[:3:2], [(0.0, 0.0), (0.6, 0.2), (0.9, 0.2)])]
PADS = Drone(stiffness=DAMPED.stiffness, damping=DAMPED.damping, capture=0.9, capture_spread=0.2)


@pytest.fixture(scope="module")
def found(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """What the command writes of thirteen landings with pads that the vehicle file does not have; nobody said
    how the last one ended, so that they are just enough for a name."""
    folder: Path = tmp_path_factory.mktemp("pads")
    write_outcomes(PADS, LEAST_NAMING + 1, 1, folder / "f", folder / "answer.json")
    labels = folder / "f" / "labels.csv"
    labels.write_text("\n".join(labels.read_text(encoding="utf-8").splitlines()[:-1]) + "\n")
    command = ["gap", "landings", "--data", str(folder / "f"), "--vehicle", VEHICLE, "--draws", "20"]
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("calibration.gap.landings.outcomes.document.grid", lambda *_: tuple(POINTS))
        assert run([*command, "--search", "--out", str(folder / "out")]) == 0
    return folder / "out"


def document(found: Path) -> dict[str, Any]:
    return dict(json.loads((found / "landings.json").read_text(encoding="utf-8")))


def test_the_error_of_the_vehicle_as_filed_is_not_applied_to_the_one_that_was_found(found: Path) -> None:
    """Feet that always hold promise far too much; the vehicle that was written does not, and each has its
    own error in the document."""
    corrected = LearningSetup(vehicle=str(found / "vehicle.toml"))
    before = known_error(LearningSetup(vehicle=VEHICLE), found / "landings.json")
    after = known_error(corrected, found / "landings.json")
    assert before is not None
    assert after is not None
    assert before.mean[0] < -0.7
    assert abs(after.mean[0]) < 0.5 * abs(before.mean[0])
    assert after.mean[1] > before.mean[1] + 0.3
    assert document(found)["improved"]["expectation"]["model_error"]["offset"]["value"] == after.mean[0]


def test_a_document_of_another_vehicle_is_refused(found: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for other in (LearningSetup(), LearningSetup(vehicle=str(found / "vehicle.toml"), legs="wide-long")):
        with pytest.raises(ModelErrorFileError, match=f"another vehicle \\({VEHICLE}\\)"):
            known_error(other, found / "landings.json")
    command = ["learn", "validate", "--policy", "default", "--landings", str(found / "landings.json")]
    assert run([*command, "--out", str(found / "validated")]) == 2
    assert "vehicle.toml that was written with this file" in " ".join(capsys.readouterr().err.split())
    assert not (found / "validated").exists()


def test_the_source_of_a_number_counts_the_flights_that_are_classified(found: Path) -> None:
    assert len(document(found)["flights"]) == LEAST_NAMING + 1
    assert document(found)["score"]["flights"] == LEAST_NAMING
    assert f"outcomes of {LEAST_NAMING} flights" in (found / "vehicle.toml").read_text(encoding="utf-8")


def test_who_judges_a_vehicle_by_the_flights_that_it_was_found_with_is_told(found: Path) -> None:
    """Not where nothing of it is from landings."""
    (said,) = found_in_landings(load_vehicle(str(found / "vehicle.toml")))
    assert f"gap landings: outcomes of {LEAST_NAMING} flights, seed 0" in said
    assert "pad_capture.speed" in said
    assert said.endswith("are in sample")
    (known,) = found_in_landings(load_vehicle("crazyflie21-upgraded"))
    assert "(pad_capture.speed: outcomes of 28 of the authors' landings" in known
    assert not any(found_in_landings(load_vehicle(VEHICLE)))
    assert not any("in sample" in sentence for sentence in document(found)["says"])


def test_the_page_says_what_runs_into_the_end_of_what_was_tried(found: Path) -> None:
    values = document(found)["search"]["models"]
    assert any(one["at_bound"] for model in values for one in model["values"].values())
    assert "(at bound)" in (found / "landings.html").read_text(encoding="utf-8")
