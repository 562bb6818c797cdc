"""The measured dispersion: what the authors' flights show, and what it does to attempts."""

import csv
import json
from dataclasses import asdict
from pathlib import Path

import numpy as np
import pytest

from calibration.flights import flight_files, open_flights
from calibration.gap.landings.outcomes import prepare
from calibration.gap.landings.outcomes.dispersion import measured_launch
from calibration.gap.landings.outcomes.document import SCHEMA
from calibration.gap.landings.outcomes.expectation import ModelErrorFileError
from onboard.json_file import as_json
from onboard.vehicle import load_vehicle
from perchhw.learning.errors import LearningInputError
from perchhw.learning.grid import Condition, conditions
from perchhw.learning.judged_range import inside_judged_range
from perchhw.learning.launch_file import launch_of
from perchhw.learning.real_rate import AUTHORS_ERROR, known_error, real_rate
from perchhw.learning.results import cues_in_words
from perchhw.learning.setup import MEASURED, SENSING, LearningSetup, recorded_setup
from sim_backend.physics.launch import EXACT, Launch


@pytest.mark.further
def test_the_preset_is_what_the_authors_flights_show(shared_data: Path) -> None:
    files = [f for f in flight_files([shared_data / "habas2022" / "flights"]) if f.name != "labels.csv"]
    flights, _ = open_flights(files)
    ready = prepare(flights, load_vehicle("crazyflie21-upgraded"), np.random.default_rng(0), 20)
    found = measured_launch(ready.starts, ready.measured_ceilings, ready.dispersion.height)
    assert found is not None
    preset = SENSING[MEASURED].launch
    for name, value in asdict(found).items():
        if name not in ("flights", "sessions", "ceiling_flights"):
            assert getattr(preset, name) == pytest.approx(value, abs=6e-4), name
    assert preset.flip_spread == pytest.approx(ready.dispersion.pitch, abs=6e-4)
    assert preset.flip_roll == pytest.approx(ready.dispersion.roll, abs=6e-4)
    x, _, z = ready.dispersion.velocity
    assert SENSING[MEASURED].velocity_bias == pytest.approx(0.5 * (x + z), abs=6e-4)


def test_the_other_presets_launch_as_told() -> None:
    assert all(rules.launch == EXACT for name, rules in SENSING.items() if name != MEASURED)


def test_whose_error_is_known(tmp_path: Path) -> None:
    """That of the vehicle whose real flights were judged; of another one by its own flights."""
    assert known_error(LearningSetup(), None) == AUTHORS_ERROR
    assert known_error(LearningSetup(legs="wide-long"), None) is None
    assert known_error(LearningSetup(vehicle="crazyflie21-upgraded-stored"), None) is None
    own = tmp_path / "landings.json"
    flown = LearningSetup(legs="wide-long")
    vehicle = {"schema": SCHEMA, "vehicle_sha256": flown.describe()["vehicle_sha256"]}
    own.write_text(json.dumps({**vehicle, "expectation": {"model_error": as_json(AUTHORS_ERROR)}}))
    assert known_error(flown, own) == AUTHORS_ERROR
    with pytest.raises(ModelErrorFileError, match="another vehicle"):
        known_error(LearningSetup(), own)
    own.write_text(json.dumps(vehicle))
    with pytest.raises(ModelErrorFileError, match="has no expectation"):
        known_error(flown, own)
    with pytest.raises(LearningInputError, match="cannot be read"):
        known_error(LearningSetup(), tmp_path / "none.json")


def test_a_lab_learns_with_its_own_scatter(tmp_path: Path) -> None:
    """What `gap landings` says of a lab's flights becomes the launch of the rollouts, and is recorded."""
    own = tmp_path / "landings.json"
    values = {name: 0.01 * k for k, name in enumerate(Launch._fields, start=1)}
    dispersion = {"pitch": values.pop("flip_spread"), "roll": values.pop("flip_roll")}
    document = {"schema": SCHEMA, "launch": {"flights": 9, **values}, "dispersion": dispersion}
    own.write_text(json.dumps(document))
    setup = LearningSetup(sensing=MEASURED, launch=launch_of(own))
    _, rules = setup.load()
    assert rules.rollout.launch == pytest.approx([0.01 * k for k in range(1, 10)])
    assert rules.rollout.velocity_bias == SENSING[MEASURED].velocity_bias
    assert recorded_setup(json.loads(json.dumps(setup.describe())), "sweep") == setup
    assert "launch" not in LearningSetup().describe()  # folders of before go on
    unknown = {**document, "launch": {**values, "ceiling": None, "ceiling_spread": None}}
    for lacks in ({"schema": SCHEMA, "launch": None}, unknown):
        own.write_text(json.dumps(lacks))
        with pytest.raises(LearningInputError, match="at least five flights"):
            launch_of(own)


def test_conditions_without_a_trigger_expect_nothing() -> None:
    rows = [{"trigger_rate": 0.0, "four_leg_rate": 0.0}, {"trigger_rate": 0.5, "four_leg_rate": 0.4}]
    expected = real_rate(rows, AUTHORS_ERROR, 0)
    low, high = expected.ci95
    assert 0.0 < low < expected.four_leg_rate < high < 0.25


def test_how_many_conditions_are_like_the_judged_flights() -> None:
    grid = conditions(np.arange(1.5, 3.51, 0.25), np.arange(30.0, 91.0, 5.0))
    assert inside_judged_range(grid) == pytest.approx(30 / 117)


def test_the_judged_range_holds_most_of_the_judged_flights(shared_data: Path) -> None:
    with (shared_data / "habas2022" / "flights" / "labels.csv").open(encoding="utf-8") as file:
        rows = [row for row in csv.DictReader(file) if row["outcome"]]
    flown = [Condition(float(row["speed_m_s"]), float(row["angle_deg"])) for row in rows]
    assert inside_judged_range(flown) > 0.8


def test_a_launch_of_its_own_is_named() -> None:
    """With it, the cues that were asked for come with a lab's own scatter of approaches."""
    assert cues_in_words(LearningSetup().describe()) == "realistic cues"
    own = LearningSetup(launch=tuple(EXACT))
    assert cues_in_words(own.describe()) == "realistic cues and the launch of --launch"
