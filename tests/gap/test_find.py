"""``perchhw gap find`` as its user calls it: files in, report and vehicle out, nothing claimed too much."""

import io
import json
import shutil
from contextlib import redirect_stderr, redirect_stdout
from pathlib import Path
from typing import Any

import pytest

from onboard.vehicle import load_vehicle
from perchhw.cli.main import run
from tests.truth.hidden_effects.campaign import make_flights

FLIGHTS = 3


@pytest.fixture(scope="module")
def flights(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("hidden")
    make_flights("rotor_drag", "strong", 11, FLIGHTS, out=folder / "flights", answer=folder / "answer.json")
    return folder


def find(out: Path, *data: Path, vehicle: str = "crazyflie21-stock") -> tuple[int, dict[str, Any]]:
    """The command on files: its exit code and what it prints."""
    options = ("--vehicle", vehicle, "--out", str(out), "--data", *map(str, data))
    with redirect_stdout(io.StringIO()) as said:
        code = run(["--json", "gap", "find", *options])
    return code, json.loads(said.getvalue())


@pytest.fixture(scope="module")
def found(flights: Path, tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, int, dict[str, Any]]:
    """What it writes, its exit code and what it prints of all flights."""
    out = tmp_path_factory.mktemp("found")
    broken = flights / "broken.csv"
    broken.write_text("t,x,y,z,qx,qy,qz,qw\n0,0,oops,0,0,0,0,1\n")
    with redirect_stderr(io.StringIO()) as told:
        said = find(out, flights / "flights", broken)
    assert "broken.csv" in told.getvalue()  # whoever reads the verdict is told what it is not on
    return (out, *said)


def test_report_and_improved_vehicle(flights: Path, found: tuple[Path, int, dict[str, Any]]) -> None:
    folder, code, report = found
    assert code == 0
    assert json.loads((folder / "report.json").read_text()) == report
    assert report["schema"] == "perchhw.gap/1"
    assert report["verdict"] == "effects_found"
    assert [effect["name"] for effect in report["effects"]] == ["rotor_drag"]
    hidden = json.loads((flights / "answer.json").read_text())["effects"][0]["parameters"]["coefficient"]
    named = report["effects"][0]
    assert named["parameters"]["coefficient"]["value"] == pytest.approx(hidden, rel=0.05)
    assert named["error_after"] < 0.8 * named["error_before"]
    assert set(report["flights"]["train"]).isdisjoint(report["flights"]["held_out"])
    assert len(report["flights"]["train"] + report["flights"]["held_out"]) == FLIGHTS
    assert report["where"][0]["channel"].endswith(("_x", "_y"))
    assert report["landings"] is None
    assert report["settings"]["ceiling_z_m"] is None
    assert {"perchhw", "numpy"} <= set(report["settings"]["versions"])
    improved = load_vehicle(folder / "vehicle.toml")
    (effect,) = improved.effects
    assert effect.values()["coefficient"] == named["parameters"]["coefficient"]["value"]
    assert "gap finder" in effect.parameters["coefficient"].source
    assert "<html" in (folder / "report.html").read_text()


@pytest.mark.further
def test_with_the_vehicle_that_was_found_there_is_nothing_more_to_find(
    flights: Path, found: tuple[Path, int, dict[str, Any]], tmp_path: Path
) -> None:
    first = found[0] / "vehicle.toml"
    _, report = find(tmp_path, flights / "flights", vehicle=str(first))
    assert report["effects"] == []
    assert report["verdict"] == "no_gap"
    again = load_vehicle(tmp_path / "vehicle.toml")
    assert again.effects == load_vehicle(first).effects


@pytest.mark.soak
def test_names_and_order_of_the_files_decide_nothing(flights: Path, tmp_path: Path) -> None:
    files = sorted((flights / "flights").iterdir())
    renamed = [Path(shutil.copy(file, tmp_path / f"{n}.csv")) for n, file in enumerate(reversed(files))]
    _, as_flown = find(tmp_path / "a", *files)
    _, as_called = find(tmp_path / "b", *renamed)
    assert as_flown["verdict"] == as_called["verdict"]
    assert as_flown["effects"] == as_called["effects"]
    assert as_flown["gap"] == as_called["gap"]


@pytest.mark.further
def test_one_flight_and_its_copy_confirm_nothing(flights: Path, tmp_path: Path) -> None:
    one = flights / "flights" / "circle_fast_rep1.csv"
    copy = shutil.copy(one, tmp_path / "copy.csv")
    code, report = find(tmp_path / "out", one, Path(copy))
    assert code == 0
    assert report["effects"] == []
    assert report["verdict"] == "unexplained_gap"
    assert "rotor_drag" in report["unexplained"]["suspects"]
    (unusable,) = report["flights"]["unusable"]
    assert unusable["reason"].startswith("holds the same numbers")


@pytest.mark.soak  # what is said of them is tested without a search too
def test_flights_without_a_voltage_are_used_and_it_is_said_what_that_costs(
    flights: Path, tmp_path: Path
) -> None:
    for path in sorted((flights / "flights").glob("*.csv"))[:2]:
        rows = [line.rsplit(",", 1)[0] for line in path.read_text().splitlines()]
        assert path.read_text().splitlines()[0].endswith(",vbat")
        (tmp_path / path.name).write_text("\n".join(rows) + "\n")
    code, answer = find(tmp_path / "out", *sorted(tmp_path.glob("*.csv")))
    assert code == 0
    assert any("no battery voltage" in text and "thrust_scale" in text for text in answer["limitations"])
    assert answer["flights"]["unusable"] == []
