"""Which flight tells two effects apart: courses, expected separations, the file that flies them."""

import json
import math
import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from calibration.gap.suggest.campaign_file import flights_file, landings_file
from calibration.gap.suggest.hypothesis import Hypothesis
from calibration.gap.suggest.landing_separation import LANDINGS, landing_separation
from calibration.gap.suggest.open_questions import GapReportError, OpenQuestions, read_questions
from calibration.gap.suggest.separation import separation
from calibration.gap.suggest.simulate import fly_course
from calibration.gap.suggest.spectra import noise_spectra, weighed
from calibration.gap.suggest.suggestions import Suggester, Suggestion
from onboard.manoeuvres import MANOEUVRES, manoeuvre
from onboard.room import RoomGeometry
from onboard.vehicle import load_vehicle
from perchhw.campaign import load_plan
from perchhw.campaign.courses import load_flight_plan
from perchhw.cli.main import run

ROOM = RoomGeometry()
VEHICLE = load_vehicle("crazyflie21-upgraded-stored")


@pytest.mark.parametrize("kind", sorted(set(MANOEUVRES) - {"near_ceiling"}))
def test_a_healthy_and_a_weak_vehicle_can_fly_every_course(kind: str) -> None:
    weak = Hypothesis("thrust_scale", {"scale": 0.88}).on(Hypothesis("motor_lag", {"scale": 1.3}).on(VEHICLE))
    for vehicle in (VEHICLE, weak):
        values = {"seconds": 5.0} if kind == "long_discharge" else {}
        course = manoeuvre(kind).course(values, ROOM)
        record = fly_course(vehicle, course, ROOM, np.random.default_rng(1), kind)
        assert record is not None
        tilt = np.degrees(np.arccos(1.0 - 2.0 * (record.attitude[:, 0] ** 2 + record.attitude[:, 1] ** 2)))
        assert tilt.max() < 60.0


def test_weighing_gives_the_log_likelihood_of_a_known_noise() -> None:
    """Noise with the assumed spectrum has a weighed square of one per number."""
    rng = np.random.default_rng(3)
    count, keep = 4096, math.exp(-0.01 / 0.4)
    force = np.empty(count)
    force[0] = 0.06 * rng.standard_normal()
    for k in range(1, count):
        force[k] = keep * force[k - 1] + 0.06 * math.sqrt(1.0 - keep**2) * rng.standard_normal()
    gyro = 0.01 * rng.standard_normal(count + 1)
    signals = np.zeros((count, 13))
    signals[:, 0] = force + 0.05 * rng.standard_normal(count)
    signals[:, 10] = gyro[1:]
    squares = weighed(signals, noise_spectra(count, 0.01)) ** 2
    by_channel = squares.reshape(2, -1, 13).sum(axis=(0, 1))
    assert by_channel[0] == pytest.approx(count, rel=0.1)
    # The rate against motion capture has the noise of attitude on top of that of the gyro.
    assert by_channel[10] < count


def expected(true: str, other: str, kind: str) -> float:
    course = manoeuvre(kind).course({}, ROOM)
    return separation(VEHICLE, Hypothesis.typical(true), other, course, ROOM, 0).log_likelihood_ratio


def test_mass_and_thrust_scale_are_one_thing_to_every_flight() -> None:
    for kind in ("thrust_steps", "attitude_doublets", "circles"):
        assert expected("thrust_scale", "mass_error", kind) < 0.5
        assert expected("mass_error", "thrust_scale", kind) < 0.5


def test_an_effect_cannot_be_told_from_itself() -> None:
    assert expected("motor_lag", "motor_lag", "thrust_steps") < 0.5


def test_flights_separate_what_they_excite() -> None:
    assert expected("command_delay", "motor_lag", "thrust_steps") > 100.0
    hover = manoeuvre("long_discharge").course({"seconds": 13.0}, ROOM)
    idle = separation(VEHICLE, Hypothesis.typical("rotor_drag"), "body_drag", hover, ROOM, 0)
    assert idle.log_likelihood_ratio < 2.0
    assert expected("rotor_drag", "body_drag", "circles") > 100.0
    assert expected("ceiling_effect", "thrust_scale", "circles") < 0.5
    assert expected("ceiling_effect", "thrust_scale", "near_ceiling") > 5.0


def test_landings_separate_effects_of_the_hinge_and_not_an_effect_from_itself() -> None:
    soft = Hypothesis("leg_stiffness", {"scale": 0.3})
    assert landing_separation(VEHICLE, soft, "leg_damping", ROOM).log_likelihood_ratio > 30.0
    assert landing_separation(VEHICLE, soft, "leg_stiffness", ROOM).log_likelihood_ratio < 2.0


def report(folder: Path, **changes: object) -> Path:
    """A report with an open question of each kind."""
    document = {
        "schema": "perchhw.gap/1",
        "verdict": "effects_found",
        "effects": [
            {
                "name": "thrust_scale",
                "parameters": {"scale": {"value": 0.9, "unit": "1", "ci95": [0.89, 0.91]}},
                "ambiguous_with": ["mass_error"],
            },
            {
                "name": "leg_stiffness",
                "parameters": {"scale": {"value": 0.3, "unit": "1", "ci95": [0.2, 0.4]}},
                "ambiguous_with": ["leg_damping"],
            },
        ],
        "unexplained": {"share": 0.1, "channels": [], "suspects": ["motor_lag", "height", "command_delay"]},
        **changes,
    }
    path = folder / "report.json"
    path.write_text(json.dumps(document))
    return path


def test_the_questions_of_a_report_are_asked_once_each(tmp_path: Path) -> None:
    path = report(tmp_path, ambiguous=[{"names": ["mass_error", "thrust_scale", "battery_sag"]}])
    questions = read_questions(path)
    assert questions.pairs == (
        ("thrust_scale", "mass_error"),
        ("leg_stiffness", "leg_damping"),
        ("mass_error", "battery_sag"),
        ("motor_lag", "command_delay"),
    )
    assert questions.values_of("thrust_scale").values == {"scale": 0.9}
    assert questions.values_of("mass_error") == Hypothesis.typical("mass_error")


@pytest.mark.parametrize(
    ("text", "message"),
    [("{", "is not JSON"), ("[]", "is not a report"), ('{"schema": "perchhw.gap/1"}', "lacks")],
)
def test_a_file_that_is_no_report_is_refused(text: str, message: str, tmp_path: Path) -> None:
    path = tmp_path / "report.json"
    path.write_text(text)
    with pytest.raises(GapReportError, match=message):
        read_questions(path)


@pytest.mark.further
def test_a_question_that_no_flight_answers_gets_its_measurement(tmp_path: Path) -> None:
    path = report(tmp_path)
    kinds = ("thrust_steps", "circles", "tour")
    search = Suggester(VEHICLE, RoomGeometry(x_min=-3.5, x_max=-1.5), kinds=kinds)
    mass, legs, delay = search.suggest(read_questions(path))
    assert mass.flight is None
    assert "weigh" in str(mass.advice)
    assert legs.flight == "landings"
    assert delay.flight is not None
    assert delay.advice is None
    rates = [found.per_second for _, found in delay.ranking]
    assert rates == sorted(rates, reverse=True)
    assert "tour" not in dict(delay.ranking)


def test_of_two_effects_of_which_one_contains_the_other_the_simpler_is_kept() -> None:
    questions = OpenQuestions((), (("motor_imbalance", "thrust_scale"),))
    (suggestion,) = Suggester(VEHICLE, ROOM, kinds=("thrust_steps",)).suggest(questions)
    assert suggestion.flight is None
    assert "keep thrust_scale" in str(suggestion.advice)


def test_a_mass_and_a_thrust_are_measured_though_a_mass_does_all_that_a_scale_does() -> None:
    questions = OpenQuestions((), (("thrust_scale", "mass_error"),))
    (suggestion,) = Suggester(VEHICLE, ROOM, kinds=("thrust_steps",)).suggest(questions)
    assert "keep" not in str(suggestion.advice)
    assert "weigh the drone" in str(suggestion.advice)
    assert "calibrate thrust" in str(suggestion.advice)


def test_what_is_written_is_a_campaign_that_can_be_flown(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    arguments = ["--report", str(report(tmp_path)), "--vehicle", "crazyflie21-upgraded-stored"]
    assert run(["gap", "suggest", *arguments, "--only", "thrust_steps", "--only", "circles", "--json"]) == 0
    document = json.loads(capsys.readouterr().out)
    flights, landings = (Path(path) for path in document["campaigns"])
    plan = load_flight_plan(flights)
    chosen = next(s for s in document["suggestions"] if s["effects"] == ["motor_lag", "command_delay"])
    assert [flight.kind for flight in plan.flights] == [chosen["flight"]] * chosen["times"]
    assert len(load_plan(landings).slots()) == 9


@pytest.mark.parametrize(("kind", "write"), [("circles", flights_file), (LANDINGS, landings_file)])
@pytest.mark.parametrize("folder", ["\N{HELICOPTER}", 'a "quoted" one', "del\x7f"])
def test_a_vehicle_may_lie_in_a_folder_of_any_name(kind: str, write: Any, folder: str) -> None:
    vehicle = f"/data/{folder}/mine.toml"
    wanted = [Suggestion(("wind", "leg_damping"), kind, 1, (), None)]
    text = write(wanted, folder, "udp://127.0.0.1:19850", "vicon://127.0.0.1:18801", vehicle, ROOM)
    written = tomllib.loads(text)
    assert (written["name"], written["vehicle"]) == (folder, vehicle)


def test_a_vehicle_must_be_named_or_beside_the_report(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(["gap", "suggest", "--report", str(report(tmp_path))]) == 2
    assert "--vehicle" in capsys.readouterr().err
