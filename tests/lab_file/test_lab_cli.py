"""The lab file on the command line: refusals before anything is connected, campaigns that leave it out."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

from perchhw.campaign import load_plan
from perchhw.campaign.courses import load_flight_plan
from perchhw.cli.main import run
from perchhw.lab import LabRequired, read_lab
from tests.lab_file.labs import LAB

FLY = ["--json", "fly", "--speed", "2.5", "--angle", "55"]
RADIO = ["--drone", "radio://0/80/2M/E7E7E7E7E7"]
ROOM = ["--mocap", "vicon://127.0.0.1:18801?subject=cf1"]
GRID = 'schema = "perchhw.campaign/1"\n[grid]\nspeeds = [2.0]\nangles_deg = [60.0]\n'
FLIGHTS = 'schema = "perchhw.campaign/1"\n[[flight]]\nkind = "vertical_steps"\n'


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


def error_of(capsys: pytest.CaptureFixture[str], arguments: list[str]) -> str:
    assert run(arguments) == 2
    document = json.loads(capsys.readouterr().out)
    assert document["exit_code"] == 2
    return str(document["error"])


def test_nothing_given_says_what_to_do(capsys: pytest.CaptureFixture[str]) -> None:
    assert "--drone: missing; give it, or a lab file" in error_of(capsys, FLY)
    assert "--mocap: missing; give it, or a lab file" in error_of(
        capsys, [*FLY, "--drone", "udp://127.0.0.1:9"]
    )


@pytest.mark.parametrize(
    "addresses",
    [
        [*RADIO, *ROOM],
        ["--drone", "usb://0", *ROOM],
        ["--drone", "udp://192.0.2.1:19850", *ROOM],
        ["--drone", "udp://127.0.0.1:9", "--mocap", "vicon://192.0.2.1?subject=cf1"],
    ],
)
@pytest.mark.parametrize("more", [[], ["--put-back", "--yes"], ["--dry-run"]])
def test_hardware_without_a_lab_file_is_refused_before_it_is_touched(
    addresses: list[str], more: list[str], capsys: pytest.CaptureFixture[str], folder: Path
) -> None:
    assert "nothing flies without a lab file" in error_of(capsys, [*FLY, *addresses, *more])
    assert list(folder.rglob("*")) == []


def test_a_broken_file_in_the_working_folder_is_not_passed_over(
    capsys: pytest.CaptureFixture[str], folder: Path
) -> None:
    (folder / "lab.toml").write_text(LAB.replace("x_min", "x_mim"))
    said = error_of(capsys, [*FLY, "--drone", "udp://127.0.0.1:9", *ROOM])
    assert "lab.toml: room.x_mim: unknown key; did you mean 'x_min'?" in said


def test_what_cannot_be_flown_is_told_also_while_another_process_flies_the_drone(
    capsys: pytest.CaptureFixture[str], folder: Path, own_drone_files: Path
) -> None:
    (folder / "lab.toml").write_text(LAB)
    holder = "import sys; from onboard.link.exclusive import hold; from onboard.link import machine_files; "
    holder += "from pathlib import Path; machine_files.FOLDER = Path(sys.argv[1]); "
    holder += "held = hold(sys.argv[2]); print(flush=True); sys.stdin.read()"
    line = [sys.executable, "-c", holder, str(own_drone_files), read_lab(folder / "lab.toml").drones[0].uri]
    with subprocess.Popen(line, stdin=subprocess.PIPE, stdout=subprocess.PIPE) as other:
        assert other.stdout is not None
        other.stdout.readline()
        assert "is in use by" in error_of(capsys, FLY)
        assert "speed 1e+09 m/s" in error_of(capsys, [*FLY, "--speed", "1e9"])
        other.communicate()


def test_an_approach_must_fit_the_room_of_the_lab_file(
    capsys: pytest.CaptureFixture[str], folder: Path
) -> None:
    (folder / "small.toml").write_text(
        LAB.replace("x_min = -3.0", "x_min = -1.0").replace("x = -2.0", "x = -0.5")
    )
    assert "does not fit the room" in error_of(capsys, [*FLY, "--lab", "small.toml"])


@pytest.mark.parametrize(
    ("option", "value", "said"),
    [
        ("--ceiling", "nan", "--ceiling: nan is not a finite number"),
        ("--ceiling", "100", "--ceiling: is 100 m; it must be 1 to 4 m"),
        ("--speed", "nan", "--speed: nan is not a finite number"),
        (
            "--speed",
            "1e9",
            "speed 1e+09 m/s is too fast; give a speed of less than 10 m/s. What fits: 3.35",
        ),
        ("--angle", "inf", "--angle: inf is not a finite number"),
        ("--angle", "0.87", "That looks like radians; write degrees (49.85)"),
        ("--speed", "250", "That looks like centimetres a second; write metres a second (2.5)"),
        ("--ceiling", "210", "That looks like centimetres; write metres (2.1)"),
        ("--ceiling", "2100", "That looks like millimetres; write metres (2.1)"),
    ],
)
def test_an_absurd_option_is_refused_by_its_name(
    option: str, value: str, said: str, capsys: pytest.CaptureFixture[str], folder: Path
) -> None:
    (folder / "lab.toml").write_text(LAB)
    assert said in error_of(capsys, [*FLY, option, value])
    assert not list(folder.glob("runs/*"))


def test_a_limit_out_of_its_range_ends_even_a_dry_run(
    capsys: pytest.CaptureFixture[str], folder: Path
) -> None:
    (folder / "lab.toml").write_text(LAB + "[limits]\ntilt_in_hover = 25\n")
    said = error_of(capsys, [*FLY, "--dry-run"])
    assert "lab.toml: limits.tilt_in_hover: is 25 rad; it must be 15 to 45 deg" in said
    assert "degrees" in said


@pytest.mark.parametrize("text", [GRID, FLIGHTS])
def test_a_campaign_on_hardware_needs_a_lab_file(
    text: str, capsys: pytest.CaptureFixture[str], folder: Path
) -> None:
    addresses = f'drone = "{RADIO[1]}"\nmocap = "{ROOM[1]}"\n'
    (folder / "c.toml").write_text(addresses + text)
    assert "nothing flies without a lab file" in error_of(capsys, ["--json", "campaign", "run", "c.toml"])
    assert [path.name for path in folder.iterdir()] == ["c.toml"]


def test_a_campaign_leaves_out_what_the_lab_file_gives(folder: Path) -> None:
    (folder / "lab.toml").write_text(LAB)
    lab = read_lab(folder / "lab.toml")
    file = folder / "c.toml"
    file.write_text(GRID)
    plan = load_plan(file, lab)
    assert (plan.drone, plan.mocap) == (lab.drones[0].uri, "vicon://127.0.0.1:18801?subject=cf1")
    assert plan.room == lab.room.geometry()
    assert plan.lab is lab
    file.write_text(
        'vehicle = "crazyflie21-stock"\nlegs = "wide-long"\n' + GRID + "[room]\nceiling_z = 2.2\n"
    )
    changed = load_plan(file, lab)
    assert (changed.vehicle, changed.legs) == ("crazyflie21-stock", "wide-long")
    assert (changed.room.ceiling_z, changed.room.x_max) == (2.2, 1.5)
    file.write_text(FLIGHTS)
    flights = load_flight_plan(file, lab)
    assert flights.request(0, folder).lab is lab
    assert flights.setup.room == plan.room


def test_a_resumed_campaign_may_have_new_limits_but_not_another_room(folder: Path) -> None:
    (folder / "lab.toml").write_text(LAB)
    file = folder / "c.toml"
    file.write_text(GRID)
    first = load_plan(file, read_lab(folder / "lab.toml")).fixed_part()
    (folder / "lab.toml").write_text(LAB + "[limits]\nbattery_at_rest = 3.9\n")
    assert load_plan(file, read_lab(folder / "lab.toml")).fixed_part() == first
    (folder / "lab.toml").write_text(LAB.replace("height = 2.4", "height = 2.3"))
    assert load_plan(file, read_lab(folder / "lab.toml")).fixed_part() != first


def test_what_neither_gives_is_a_key_of_the_campaign_file(folder: Path) -> None:
    (folder / "c.toml").write_text(GRID)
    from perchhw.campaign import CampaignFileError

    with pytest.raises(CampaignFileError, match=r"c\.toml: key drone: missing; give it, or a lab file"):
        load_plan(folder / "c.toml")


def test_the_library_refuses_hardware_as_the_command_line_does(folder: Path) -> None:
    from perchhw.attempt import AttemptRequest
    from perchhw.flight import fly_attempt
    from perchhw.flight.course import CourseRequest, fly_course

    where = {"folder": folder / "run", "drone": RADIO[1], "mocap": ROOM[1], "vehicle": "crazyflie21-upgraded"}
    with pytest.raises(LabRequired):
        fly_attempt(AttemptRequest(speed=2.5, angle_deg=55.0, index=0, policy="default", **where))
    with pytest.raises(LabRequired):
        fly_course(CourseRequest(kind="vertical_steps", **where))
    assert not (folder / "run").exists()


def test_an_option_beats_the_environment_which_beats_the_lab_file(
    folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    (folder / "elsewhere.toml").write_text(LAB)
    monkeypatch.setenv("PERCHHW_LAB", "elsewhere.toml")
    monkeypatch.setenv("PERCHHW_LEGS", "short")
    assert "there is no design 'short'" in error_of(capsys, FLY)
    assert "there is no design 'long'" in error_of(capsys, [*FLY, "--legs", "long"])
    monkeypatch.setenv("PERCHHW_DRONE", "nowhere://1")
    assert "nowhere://1" in error_of(capsys, FLY)
    assert "elsewhere://2" in error_of(capsys, [*FLY, "--drone", "elsewhere://2"])
