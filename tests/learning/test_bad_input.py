"""What a sweep refuses, and why: grids, folders, other versions, vehicles and settings, damage."""

import json
from collections.abc import Callable
from pathlib import Path

import pytest

from onboard.vehicle import load_vehicle, vehicle_to_toml
from onboard.vehicle.fingerprint import fingerprint
from perchhw.cli.main import run
from perchhw.learning.errors import LearningInputError
from perchhw.learning.executor import LocalThreads
from perchhw.learning.setup import LearningSetup
from perchhw.learning.sweep import SweepGrid, run_sweep

GRID = SweepGrid((2.5,), (40.0, 50.0), 1)
SETUP = LearningSetup(seed=7)
VEHICLE = "crazyflie21-upgraded"


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (("--repeats", "0"), "--repeats 0 makes no attempt"),
        (("--speeds", "0"), "a speed of 0 m/s makes no approach"),
        (("--speeds=-2",), "a speed of -2 m/s"),
        (("--speeds", "nan"), "--speeds 'nan' is not a range"),
        (("--angles", "0"), "an angle of 0 deg makes no approach"),
        (("--angles", "90.5"), "an angle of 90.5 deg"),
        (("--speeds", "2,2"), "2 m/s is given twice"),
        (("--speeds", "3:2:0.1"), "is not a range"),
        (("--speeds", "1:2:1e-9"), "at most 1000 values"),
        (("--speeds", ""), "is not a range"),
        (("--vehicle", "nothing"), "no such vehicle"),
        (("--randomise", "legs.colour"), "no quantity 'legs.colour'"),
    ],
)
def test_a_sweep_that_cannot_be_done_is_refused_before_its_folder_is_made(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], options: tuple[str, ...], words: str
) -> None:
    assert run(["--json", "learn", "sweep", *options, "--out", str(tmp_path / "out")]) == 2
    assert words in json.loads(capsys.readouterr().out)["error"]
    assert not (tmp_path / "out").exists()


def test_steep_and_flat_angles_are_approaches() -> None:
    assert len(list(SweepGrid((2.0,), (1.0, 90.0), 1).keys())) == 2


@pytest.mark.parametrize("verb", ["sweep", "train", "validate"])
def test_an_unwritable_folder_is_named(tmp_path: Path, capsys: pytest.CaptureFixture[str], verb: str) -> None:
    (tmp_path / "file").write_text("not a folder")
    out = tmp_path / "file" / "out"
    run_sweep(SETUP, GRID, tmp_path / "swept")
    options = {
        "train": ["--pairs", str(tmp_path / "swept" / "pairs.csv"), "--landing-rate-min", "0"],
        "validate": ["--policy", "default", "--speeds", "2.5", "--angles", "40"],
    }
    assert run(["--json", "learn", verb, *options.get(verb, []), "--out", str(out)]) == 2
    error = json.loads(capsys.readouterr().out)["error"]
    assert str(out) in error
    assert "cannot be written (Not a directory)" in error


@pytest.fixture
def swept(tmp_path: Path) -> Path:
    """A folder with a finished sweep."""
    run_sweep(SETUP, GRID, tmp_path / "swept", executor=LocalThreads(1))
    return tmp_path / "swept"


def _resume(folder: Path, setup: LearningSetup = SETUP, grid: SweepGrid = GRID) -> None:
    run_sweep(setup, grid, folder, executor=LocalThreads(1), resume=True)


def test_another_version_is_refused(swept: Path) -> None:
    document = json.loads((swept / "sweep.json").read_text())
    document["versions"]["numba"] = "0.1"
    (swept / "sweep.json").write_text(json.dumps(document))
    with pytest.raises(LearningInputError, match=r"numba is '0\.1' there and '.*' now.*another --out"):
        _resume(swept)


def test_another_grid_is_refused(swept: Path) -> None:
    with pytest.raises(LearningInputError, match=r"angles_deg is \[40\.0, 50\.0\] there and \[40\.0\] now"):
        _resume(swept, grid=SweepGrid((2.5,), (40.0,), 1))


def test_another_vehicle_of_the_same_name_is_refused_but_not_another_wording(tmp_path: Path) -> None:
    file, folder = tmp_path / "mine.toml", tmp_path / "swept"
    text = vehicle_to_toml(load_vehicle(VEHICLE))
    file.write_text(text)
    setup = LearningSetup(vehicle=str(file))
    run_sweep(setup, GRID, folder)
    source = load_vehicle(VEHICLE).body.mass.source
    assert source in text
    file.write_text("# weighed again\n" + text.replace(source, "the same, cited in other words"))
    _resume(folder, setup)
    file.write_text(text.replace("value = 0.0381,", "value = 0.0382,"))
    with pytest.raises(LearningInputError, match="vehicle_sha256 is"):
        _resume(folder, setup)


def test_the_fingerprint_sees_every_number_and_unit() -> None:
    text = vehicle_to_toml(load_vehicle(VEHICLE))
    for old, new in (("sigma = 0.0002", "sigma = 0.0003"), ('"N m/rad"', '"mN m/rad"'), ("arm_x", "arm_z")):
        assert old in text
        assert fingerprint(text.replace(old, new, 1)) != fingerprint(text)


def _cell(row: int, column: int, value: str) -> Callable[[str], str]:
    def change(text: str) -> str:
        lines = [line.split(",") for line in text.splitlines()]
        lines[row][column] = value
        return "\n".join(",".join(cells) for cells in lines) + "\n"

    return change


@pytest.mark.parametrize(
    ("damage", "words"),
    [
        (_cell(1, 3, "soon"), "line 2: tau is 'soon', not a number"),
        (_cell(2, 3, "nan"), "line 3: tau is 'nan', not a finite number"),
        (_cell(1, 7, "1.5"), "line 2: landing_rate is '1.5', not a rate"),
        (_cell(1, 11, ""), "line 2: rollouts is '', not a number"),
        (_cell(1, 21, "x"), "line 2: not_finite_rollouts is 'x'"),
        (_cell(1, 1, "41.0"), "line 2: 2.5 m/s, 41 deg, trial 0 is no trial of this sweep"),
        (_cell(2, 1, "40.0"), "line 3: has the trial of an earlier line"),
        (_cell(0, 1, "angle"), "line 1: the columns are not those of this version"),
        (lambda text: text.replace(",", ";"), "line 1"),
        (lambda text: text[: len(text) // 2] + "\n", "line 2: .* values, not 22|line 3: .* values, not 22"),
        (lambda text: "", "line 1"),
    ],
)
def test_a_damaged_table_names_line_and_column(swept: Path, damage: Callable[[str], str], words: str) -> None:
    table = swept / "pairs.csv"
    before = damage(table.read_text())
    table.write_text(before)
    with pytest.raises(LearningInputError, match=words):
        _resume(swept)
    assert table.read_text() == before


def test_a_table_that_is_no_text_is_named(swept: Path) -> None:
    (swept / "pairs.csv").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(LearningInputError, match=r"pairs\.csv: cannot be read"):
        _resume(swept)


@pytest.mark.parametrize("text", ["{", "[]", "{}", '{"schema": "perchhw.sweep/1", "settings": []}'])
def test_a_damaged_document_is_named(swept: Path, text: str) -> None:
    (swept / "sweep.json").write_text(text)
    with pytest.raises(LearningInputError, match=r"sweep\.json"):
        _resume(swept)
