"""``perchhw gap`` from the command line: results, exit codes, one JSON document."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from onboard.vehicle import load_vehicle, vehicle_to_toml
from perchhw.cli.main import run
from tests.gap.simulated_flight import circle, fly, up_and_down, write_table
from tests.physics.effects.conftest import with_effects

NAME = "crazyflie21-upgraded"


@pytest.fixture(scope="module")
def flights(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with two flights of a vehicle that is 5 % too weak, among other files."""
    folder = tmp_path_factory.mktemp("flights")
    rng = np.random.default_rng(7)
    truth, believed = with_effects({"thrust_scale": {"scale": 0.95}}), load_vehicle(NAME)
    for name, path in (("laps", circle()), ("climbs", up_and_down())):
        write_table(fly(truth, path, 14.0, believed=believed), folder / f"{name}.csv", rng)
    (folder / "README.md").write_text("not a flight\n")
    return folder


def call(capsys: pytest.CaptureFixture[str], *arguments: str | Path) -> tuple[int, dict[str, Any], str]:
    """Exit code, the JSON document on stdout (exactly one, or none), and stderr."""
    code = run([*(str(a) for a in arguments), "--json"])
    captured = capsys.readouterr()
    return code, json.loads(captured.out) if captured.out else {}, captured.err


def test_evaluate_shows_that_the_right_model_predicts_better(
    capsys: pytest.CaptureFixture[str], flights: Path, tmp_path: Path
) -> None:
    better = tmp_path / "better.toml"
    better.write_text(vehicle_to_toml(with_effects({"thrust_scale": {"scale": 0.95}})))
    found = []
    for vehicle in (NAME, better):
        code, document, _ = call(capsys, "gap", "evaluate", "--data", flights, "--vehicle", vehicle)
        assert code == 0
        assert document["flights"] == 2
        found.append(document)
    wrong, right = (document["given_attitude"]["1.0"]["position_m"] for document in found)
    assert wrong == pytest.approx(0.5 * 9.81 * (1 / 0.95 - 1), rel=0.1)
    assert right < 0.02
    assert set(found[0]["horizons"]) == {"0.1", "0.25", "0.5", "1.0"}
    assert set(found[0]["horizons"]["0.5"]) >= {"position_m", "velocity_m_s", "attitude_deg", "rate_rad_s"}
    assert [flight["thrust_ratio"] for flight in found[0]["by_flight"]] == pytest.approx(
        [0.95, 0.95], rel=0.01
    )


def test_evaluate_takes_several_files_behind_data(capsys: pytest.CaptureFixture[str], flights: Path) -> None:
    files = [flights / "laps.csv", flights / "climbs.csv"]
    options = ["--vehicle", NAME, "--horizons", "0.5"]
    _, document, _ = call(capsys, "gap", "evaluate", "--data", *files, *options)
    assert document["flights"] == 2
    _, again, _ = call(capsys, "gap", "evaluate", *options, "--data", files[0], "--data", files[1])
    assert again == document
    _, fitted, _ = call(capsys, "gap", "evaluate", "--data", *files, *options, "--calibrate-first-s", "8")
    assert fitted["given_attitude"]["0.5"]["position_m"] < 0.01
    assert fitted["by_flight"][0]["nuisances"]["thrust_scale"] == pytest.approx(0.95, rel=0.01)


def test_evaluate_feels_the_ceiling_that_it_is_told(
    capsys: pytest.CaptureFixture[str], flights: Path, tmp_path: Path
) -> None:
    feels = tmp_path / "feels.toml"
    feels.write_text(vehicle_to_toml(with_effects({"ceiling_effect": {"inflow": 1.0, "opening": 0.1}})))
    arguments: list[str | Path] = ["gap", "evaluate", "--data", flights / "laps.csv", "--vehicle", feels]
    free, below = (
        call(capsys, *arguments, *told)[1]["given_attitude"]["0.5"]["position_m"]
        for told in ((), ("--ceiling", "1.4"))
    )
    assert below > 1.1 * free  # these rotors lift less than the file says, not more


def test_evaluate_names_what_it_leaves_out(
    capsys: pytest.CaptureFixture[str], flights: Path, tmp_path: Path
) -> None:
    broken, copy = tmp_path / "broken.csv", tmp_path / "copy.csv"
    lines = (flights / "laps.csv").read_text().splitlines()
    copy.write_text("\n".join(lines))
    broken.write_text("\n".join([*lines[:5], lines[5].replace(lines[5].split(",")[1], "oops", 1)]))
    arguments = ["--vehicle", NAME, "--data", flights, broken, copy]
    code, document, errors = call(capsys, "gap", "evaluate", *arguments)
    assert (code, document["flights"]) == (0, 2)
    reasons = {Path(item["file"]).name: item["reason"] for item in document["unusable"]}
    assert "row 6 column 'x'" in reasons["broken.csv"]
    assert "same numbers" in reasons["copy.csv"]
    for reason in reasons.values():
        assert reason in errors


def test_evaluate_doubts_the_file_of_another_vehicle(
    capsys: pytest.CaptureFixture[str], flights: Path, tmp_path: Path
) -> None:
    heavy = tmp_path / "heavy.toml"
    heavy.write_text(vehicle_to_toml(with_effects({"mass_error": {"relative": 0.5}})))
    _, document, errors = call(capsys, "gap", "evaluate", "--vehicle", heavy, "--data", flights)
    assert "is this the vehicle that flew?" in document["doubts"][0]
    assert document["doubts"][0] in errors


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--data", "{folder}/README.md", "--vehicle", NAME], "README.md: of no known flight format"),
        (["--data", "{folder}/missing.csv", "--vehicle", NAME], "no such file"),
        (["--data", "{folder}", "--vehicle", "no-such"], "no-such"),
        (["--data", "{folder}", "--vehicle", NAME, "--horizons", "soon"], "--horizons 'soon'"),
        (["--data", "{folder}", "--vehicle", NAME, "--horizons", "0.5,nan"], "--horizons '0.5,nan'"),
        (["--data", "{folder}", "--vehicle", NAME, "--horizons", "1.0,0.5"], "increasing"),
        (["--data", "{folder}", "--vehicle", NAME, "--horizons", "60"], "no 60 s of free flight"),
        (["--data", "{folder}", "--vehicle", NAME, "--format", "xls"], "xls"),
        (["--data", "{folder}", "--vehicle", NAME, "--ceiling", "-1"], "a ceiling at -1 m cannot be"),
        (["--data", "{folder}", "--vehicle", NAME, "--ceiling", "0.6"], "above the ceiling at 0.6 m"),
        (["--vehicle", NAME], "--data"),
    ],
)
def test_what_cannot_be_used_exits_2(
    capsys: pytest.CaptureFixture[str], flights: Path, arguments: list[str], message: str
) -> None:
    filled = [argument.format(folder=flights) for argument in arguments]
    code, document, errors = call(capsys, "gap", "evaluate", *filled)
    assert code == 2
    assert message in errors
    assert document["exit_code"] == 2


@pytest.mark.parametrize(
    ("ceiling", "message"), [("0", "a ceiling at 0 m cannot be"), ("0.6", "above the ceiling at 0.6 m")]
)
def test_find_refuses_a_ceiling_that_cannot_be(
    capsys: pytest.CaptureFixture[str], flights: Path, tmp_path: Path, ceiling: str, message: str
) -> None:
    options = ["--data", flights, "--vehicle", NAME, "--out", tmp_path / "out", "--ceiling", ceiling]
    code, document, errors = call(capsys, "gap", "find", *options)
    assert (code, document["exit_code"]) == (2, 2)
    assert message in errors
    assert not list((tmp_path / "out").glob("*"))


def test_the_table_for_a_person_has_the_numbers(capsys: pytest.CaptureFixture[str], flights: Path) -> None:
    arguments = ["gap", "evaluate", "--data", str(flights), "--vehicle", NAME, "--horizons", "0.5"]
    _, document, _ = call(capsys, *arguments)
    assert run(arguments) == 0
    out = capsys.readouterr().out
    for block in (document, document["floor"]):
        for mode in ("horizons", "given_attitude"):
            assert f"{block[mode]['0.5']['position_m']:.3g}" in out
    assert f"{document['with_torque_estimate']['0.1']['rate_rad_s']:.3g}" in out
