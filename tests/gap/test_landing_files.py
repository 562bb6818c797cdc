"""What ``perchhw gap landings`` leaves in its folders, and how it tells of it."""

import json
import signal
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from onboard.vehicle import load_vehicle, vehicle_to_toml
from onboard.vehicle.fingerprint import fingerprint
from perchhw.cli.main import run
from tests.truth.landings.drone import Drone
from tests.truth.landings.judge import VEHICLE
from tests.truth.landings.outcomes import write_outcomes

LONG = "a-flight-of-a-lab-that-writes-speed-angle-room-day-hour-and-minute-into-the-names-of-its-logs"
OLDER = load_vehicle("crazyflie21-upgraded")
"""What an earlier search found and wrote."""


@pytest.fixture(scope="module")
def flown(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A day of two folders, whose flights have the same long name."""
    folder: Path = tmp_path_factory.mktemp("flown")
    write_outcomes(Drone(), 2, 7, folder / "f", folder / "answer.json")
    for number, file in enumerate(sorted((folder / "f").glob("landing*.csv"))):
        (folder / "day" / str(number)).mkdir(parents=True)
        file.rename(folder / "day" / str(number) / f"{LONG}.csv")
    return folder / "day"


@pytest.fixture
def out(tmp_path: Path) -> Path:
    """A folder with what an earlier search left."""
    folder = tmp_path / "out"
    folder.mkdir()
    written = vehicle_to_toml(OLDER)
    document = {"improved": {"vehicle_sha256": fingerprint(written)}}
    (folder / "vehicle.toml").write_text(written, encoding="utf-8")
    (folder / "landings.json").write_text(json.dumps(document), encoding="utf-8")
    (folder / "landings.html").write_text("older", encoding="utf-8")
    return folder


@pytest.fixture
def undrawn(monkeypatch: pytest.MonkeyPatch) -> None:
    """Ctrl-C as soon as the page is drawn."""

    @contextmanager
    def ctrl_c_while_drawing(what: str) -> Iterator[Callable[[float, float], None]]:
        if what == "drawing":
            signal.raise_signal(signal.SIGINT)
        yield lambda *_: None

    monkeypatch.setattr("perchhw.cli.gap_landings.share_done", ctrl_c_while_drawing)


def command(flown: Path, *more: str, vehicle: str = VEHICLE) -> list[str]:
    return ["gap", "landings", "--data", str(flown), "--vehicle", vehicle, "--draws", "20", *more]


@pytest.mark.usefixtures("undrawn")
def test_nothing_older_stays_beside_a_new_document_when_the_page_is_not_drawn(
    flown: Path, out: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(command(flown, "--out", str(out))) == 130
    assert [file.name for file in out.iterdir()] == ["landings.json"]
    assert (
        json.loads((out / "landings.json").read_text(encoding="utf-8"))["schema"] == "perchhw.gap_landings/1"
    )
    told = capsys.readouterr().out
    assert f"document: {out / 'landings.json'}" in told
    assert "page:" not in told


@pytest.mark.usefixtures("undrawn")
def test_a_vehicle_file_that_is_judged_or_of_somebody_else_stays(flown: Path, out: Path) -> None:
    judged = out / "vehicle.toml"
    assert run(command(flown, "--out", str(out), vehicle=str(judged))) == 130
    assert judged.exists()
    (out / "landings.json").write_text('{"improved": {"vehicle_sha256": "of another"}}', encoding="utf-8")
    assert run(command(flown, "--out", str(out))) == 130
    assert judged.exists()


def test_names_are_whole_and_every_flight_has_its_picture(
    flown: Path, out: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Also where output is no terminal, which rich takes for one of 80 columns."""
    shown = out / "pictures"
    assert run(command(flown, "--out", str(out), "--pictures", str(shown))) == 0
    lines = capsys.readouterr().out.splitlines()
    assert sum(line.startswith(f"{LONG} ") for line in lines) == 2
    assert lines[-1] == f"page: {out / 'landings.html'}"
    assert (out / "landings.html").read_text(encoding="utf-8") != "older"
    pictures = sorted(shown.iterdir())
    assert [file.name for file in pictures] == [f"{LONG}-2.png", f"{LONG}.png"]
    assert pictures[0].read_bytes() != pictures[1].read_bytes()


def test_a_folder_of_pictures_that_is_a_file_is_refused_by_its_option(
    flown: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "file").write_text("")
    assert run(command(flown, "--pictures", str(tmp_path / "file"))) == 2
    told = " ".join(capsys.readouterr().err.split())
    assert told.endswith("with --pictures")
    assert "--out" not in told
