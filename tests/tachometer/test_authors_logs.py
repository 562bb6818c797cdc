"""The authors' window-averaged logs against our earlier analysis (bench notes 1.2, acceptance 8)."""

from pathlib import Path

import pytest

from calibration.bench.motors.analysis import analyse
from calibration.bench.motors.figures import constants_figure, sizes_figure, steps_figure
from calibration.bench.motors.files import read_tachometer
from calibration.bench.motors.propellers import propeller
from calibration.bench.motors.tachometer_result import TachometerResult
from onboard.json_file import as_json

HOVER = 0.0381 * 9.81 / 4.0


@pytest.fixture(scope="module")
def result(shared_data: Path) -> TachometerResult:
    folder = shared_data / "habas2022" / "tachometer"
    records = [read_tachometer(path) for path in sorted(folder.glob("MS_Decay_*.csv"))]
    return analyse(records, propeller("bitcraze-2015"), HOVER)


def test_steps_are_found_without_being_told(result: TachometerResult) -> None:
    steps = [(step.name[9], round(step.begin), step.end > step.start) for step in result.steps]
    assert steps == [
        ("1", 4, True), ("1", 9, False), ("1", 14, False),
        ("3", 6, True), ("3", 11, True), ("3", 16, False),
        ("5", 4, True), ("5", 9, False),
    ]  # fmt: skip


def test_speed_law_agrees_with_the_earlier_analysis(result: TachometerResult) -> None:
    assert result.up is not None
    assert result.down is not None
    assert result.up.a_at_bound
    assert result.up.b.value == pytest.approx(4.24e-3, rel=0.05)
    assert result.down.a.value == pytest.approx(0.50, abs=0.15)
    assert result.down.b.value == pytest.approx(1.78e-3, rel=0.08)


def test_laws_rank_as_before(result: TachometerResult) -> None:
    assert result.up is not None
    assert result.down is not None
    up = [score.name for score in result.up.alternatives]
    assert up == ["drag_only", "speed_law", "speed_first_order", "thrust_first_order"]
    down = {score.name: score.aic for score in result.down.alternatives}
    assert min(down, key=lambda name: down[name]) == "speed_law"
    assert down["thrust_first_order"] - down["speed_law"] > 100.0
    assert down["drag_only"] - down["speed_law"] > 30.0


def test_thrust_constants_of_single_steps_are_those_of_the_authors_figures(result: TachometerResult) -> None:
    constants = {(step.name[9], round(step.begin)): step.thrust_constant for step in result.steps}
    for key, expected in {
        ("1", 4): 0.078, ("3", 6): 0.162, ("3", 11): 0.065, ("5", 4): 0.082,
        ("1", 14): 0.219, ("3", 16): 0.184, ("5", 9): 0.185,
    }.items():  # fmt: skip
        assert constants[key] == pytest.approx(expected, rel=0.03)


def test_the_papers_constants_follow(result: TachometerResult) -> None:
    assert result.tau_up is not None
    assert result.tau_down is not None
    assert result.tau_up.value == pytest.approx(0.06, abs=0.006)
    assert result.tau_down.value == pytest.approx(0.15, abs=0.01)
    content = as_json(result)
    assert content["tau_up"]["u95"] > 0.08 * content["tau_up"]["value"]
    assert {finding["code"] for finding in content["findings"]} >= {
        "window_averaged",
        "low_resolution",
        "few_steps",
    }


def test_figures_are_drawn(result: TachometerResult) -> None:
    for figure in (steps_figure(result), constants_figure(result), sizes_figure(result)):
        assert figure.axes[0].lines
