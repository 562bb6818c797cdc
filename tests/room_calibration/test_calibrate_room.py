"""``perchhw mocap calibrate`` in a simulated room whose lab file is wrong, and a check of its drone there."""

import json
import re
from collections.abc import Iterator
from io import StringIO
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from calibration.flights import open_flight
from calibration.gap.data import prepare_flights
from onboard.json_file import as_json
from onboard.lab_file import LabFile
from onboard.manoeuvres import manoeuvre
from onboard.room import RoomGeometry
from onboard.vehicle import load_vehicle
from perchhw.cli.check import in_words
from perchhw.cli.main import run
from perchhw.hover_check.check import examine_check
from perchhw.lab import flight_setup, read_lab
from perchhw.lab_process import FREE_PORTS, LOCKSTEP, SimulatedLab
from perchhw.record import read_run
from tests.hover_check.drones import FILE, GYRO_BIAS, WEAK_MOTOR, drone, effect

TURN, OFFSET, DELAY = np.array([0.05, -0.03, 0.08]), np.array([0.01, -0.02, 0.03]), 0.012
"""Of the tracked frame from the body: rad, m; and s that no source reports."""
HEIGHT, TILT_X, TILT_Y = 2.117, 0.8, -0.5
REPORTED = 0.004
CALIBRATE = ("mocap", "calibrate", "--within", "20")


@pytest.fixture(scope="module")
def room(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """A folder with the lab file of a room that is served: markers, ceiling and latency as they are not."""
    folder = tmp_path_factory.mktemp("room")
    true = drone(
        folder,
        effect("pose_rotation", "rad", x=TURN[0], y=TURN[1], z=TURN[2]),
        effect("pose_offset", "m", x=OFFSET[0], y=OFFSET[1], z=OFFSET[2]),
        effect("pose_delay", "s", delay=DELAY),
        WEAK_MOTOR,
        GYRO_BIAS,
    )
    survey = ("--fault", "survey_at=3:2.5", "--fault", f"survey_ceiling={HEIGHT},{TILT_X},{TILT_Y}")
    with SimulatedLab("lab", (*FREE_PORTS, *LOCKSTEP, "--vehicle", true, "--flashed", FILE, *survey)) as lab:
        # As of a real room: of one with the simulated lab's clock no tilts may be said.
        lines = Path(lab.ready["lab"]).read_text(encoding="utf-8").replace(true, FILE).splitlines()
        kept = [line for line in lines if not line.startswith("clock")]
        (folder / "lab.toml").write_text("\n".join([*kept, "# a remark", ""]), encoding="utf-8")
        yield folder


def perchhw(capsys: pytest.CaptureFixture[str], *arguments: str) -> tuple[int, Any]:
    capsys.readouterr()
    code = run(["--json", *arguments, "--yes"])
    return code, json.loads(capsys.readouterr().out)


@pytest.fixture(scope="module")
def measured(room: Path) -> tuple[dict[str, Any], LabFile]:
    """What the calibration found, and what the lab file said before."""
    before = read_lab(room / "lab.toml")
    with pytest.MonkeyPatch.context() as patch:
        said = StringIO()
        patch.setattr("sys.stdout", said)
        code = run(
            ["--json", *CALIBRATE, "--lab", str(room / "lab.toml"), "--out", str(room / "found"), "--yes"]
        )
    assert code == 0, said.getvalue()
    return json.loads(said.getvalue()), before


@pytest.mark.further  # docs/test_flight_day.py calibrates a room
def test_a_room_with_wrong_values_is_recovered_within_the_uncertainty(
    measured: tuple[dict[str, Any], LabFile],
) -> None:
    found, _ = measured
    rotation = Rotation.from_rotvec(-TURN)
    seen = found["subject_to_body"]
    for one, truth in zip(seen["position"], -rotation.apply(OFFSET), strict=True):
        assert abs(one["value"] - truth) < one["u95"] < 3e-3
    miss = (rotation.inv() * Rotation.from_quat(seen["quaternion"])).magnitude()
    assert np.degrees(miss) < 0.1
    for what, truth, most in (
        ("height", HEIGHT, 2e-3),
        ("tilt_x_deg", TILT_X, 0.2),
        ("tilt_y_deg", TILT_Y, 0.2),
    ):
        one = found["ceiling"][what]
        assert abs(one["value"] - truth) < one["u95"] < most
    assert abs(found["latency"]["value"] - (REPORTED + DELAY)) < found["latency"]["u95"] < 0.012
    assert 0.0 < found["trigger"]["u95_ceiling_s"] < found["trigger"]["u95_tau_s"] < 0.012


@pytest.mark.further  # docs/test_flight_day.py calibrates a room
def test_the_lab_file_says_it_and_keeps_the_rest(
    room: Path, measured: tuple[dict[str, Any], LabFile]
) -> None:
    found, before = measured
    lab = read_lab(room / "lab.toml")
    assert (lab.drones, lab.room.start, lab.mocap.uri) == (before.drones, before.room.start, before.mocap.uri)
    assert lab.room.ceiling.tilt_x_deg.value == found["ceiling"]["tilt_x_deg"]["value"]
    assert lab.mocap.latency_s.sigma > 0.0
    text = (room / "lab.toml").read_text(encoding="utf-8")
    assert text.startswith("# Written by")
    assert "# a remark" in text
    assert read_lab(room / "found" / "lab-before.toml") == before


@pytest.mark.further  # docs/test_flight_day.py calibrates a room
def test_its_flight_is_a_morning_check_as_well_and_feeds_the_gap_finder(
    room: Path, measured: tuple[dict[str, Any], LabFile], tmp_path: Path
) -> None:
    record = Path(measured[0]["record"])
    setup = flight_setup(read_lab(room / "lab.toml"))
    check = examine_check(record, setup, tmp_path)
    found = as_json(check)
    assert found["off_file"] == ["motor_2", "gyro_bias_x"]
    lines = {line["what"]: line for line in found["lines"]}
    assert abs(lines["motor_2"]["measured"]["value"] - 1.0 / 0.86) < 0.01
    assert abs(lines["gyro_bias_x"]["measured"]["value"] - 0.03) < 0.001
    assert "calibrate tachometer" in lines["motor_2"]["settles"]
    said = in_words(check)
    assert re.search(r"^off_file +motor_2 +116", said, re.MULTILINE)
    assert "-> exchange that propeller" in said
    assert "not as its vehicle file says: motor_2, gyro_bias_x" in said
    again = examine_check(record, setup, tmp_path)
    assert (again.checks, as_json(again)["changed"]) == (1, [])

    run_of = read_run(record)
    phases = [e["phase"] for e in run_of.events if e["event"] == "phase"]
    assert phases[-4:] == ["test flight", "landing", "disarming", "done"]
    assert "uploading" not in phases
    assert run_of.info["outcome"] == "flown"
    begin = next(e["t"] for e in run_of.events if e["event"] == "phase" and e["phase"] == "test flight")
    course = manoeuvre("attitude_doublets").course(run_of.config["parameters"], setup.room)
    pose = run_of.series["pose"]
    flying = (pose.t > begin) & (pose.t < begin + course.duration)
    for axis, name in enumerate("xyz"):
        wanted = np.interp(pose.t[flying] - begin, course.t, course.position[:, axis])
        assert np.nanmax(np.abs(pose.numbers(name)[flying] - wanted)) < 0.15
    for topic, field in (("rates", "gx"), ("acceleration", "az"), ("motors", "m1"), ("power", "vbat")):
        numbers = run_of.series[topic].numbers(field)
        assert np.isfinite(numbers).sum() / (pose.t[-1] - pose.t[0]) > 80.0, topic
    (flight,) = prepare_flights([open_flight(record)]).records
    assert flight.specific_force is not None
    assert flight.voltage is not None
    assert flight.flying.sum() * flight.dt > course.duration


@pytest.mark.further  # docs/test_flight_day.py calibrates a room
def test_done_steps_are_not_done_again(
    room: Path,
    measured: tuple[dict[str, Any], LabFile],
    capsys: pytest.CaptureFixture[str],
) -> None:
    lab = ("--lab", str(room / "lab.toml"))
    code, refused = perchhw(capsys, *CALIBRATE, *lab, "--out", str(room / "found"))
    assert code == 2
    assert "is finished and written; give another --out" in refused["error"]
    code, same = perchhw(capsys, *CALIBRATE, *lab, "--out", str(room / "found"), "--dry-run")
    assert (code, same["written"]) == (0, False)
    assert same["subject_to_body"] == measured[0]["subject_to_body"]
    assert run([*CALIBRATE, *lab, "--out", str(room / "found"), "--dry-run", "--yes"]) == 0
    said = capsys.readouterr().out
    height = same["ceiling"]["height"]
    assert f"ceiling: {height['value']:.4f} ± {height['u95']:.4f} m" in said
    assert f"{1e3 * same['latency_unreported']['value']:.1f} ms more than the source reports" in said
    assert "not written: " in said


@pytest.mark.soak
def test_a_missing_step_says_what_it_waits_for(
    room: Path,
    measured: tuple[dict[str, Any], LabFile],
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    lab = ("--lab", str(room / "lab.toml"))
    code, document = perchhw(capsys, *CALIBRATE, *lab, "--out", str(tmp_path), "--within", "6")
    assert code == 2
    assert "not seen within 6 s: the drone rests 0 deg from its first heading; turn it" in document["error"]
    assert "rest_1" in (tmp_path / "state.json").read_text(encoding="utf-8")


@pytest.mark.further  # docs/test_flight_day.py calibrates a room
def test_rests_that_cannot_be_used_are_forgotten_and_the_touches_kept(
    room: Path,
    measured: tuple[dict[str, Any], LabFile],
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    state = json.loads((room / "found" / "state.json").read_text(encoding="utf-8"))
    del state["steps"]["written"]
    askew = Rotation.from_rotvec([0.4, 0.0, 0.0]) * Rotation.from_quat(
        state["steps"]["rest_2"]["result"]["quaternion"]
    )
    state["steps"]["rest_2"]["result"]["quaternion"] = askew.as_quat().tolist()
    (tmp_path / "state.json").write_text(json.dumps(state), encoding="utf-8")
    lab = ("--lab", str(room / "lab.toml"))
    code, document = perchhw(capsys, *CALIBRATE, *lab, "--out", str(tmp_path))
    assert code == 2
    assert "level plate both times" in document["error"]
    left = json.loads((tmp_path / "state.json").read_text(encoding="utf-8"))["steps"]
    assert list(left) == ["touch_1", "touch_2", "touch_3", "touch_4"]


@pytest.mark.further  # the words and the rule are shown without a room (test_estimators.py)
def test_a_touch_that_missed_the_ceiling_is_told_and_made_again(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    survey = ("--fault", "survey_at=3:2.5", "--fault", "survey_missed=2,9")
    with SimulatedLab("lab", (*FREE_PORTS, *LOCKSTEP, *survey)) as lab:
        where = ("--lab", str(lab.ready["lab"]), "--out", str(tmp_path))
        code = run(["--json", *CALIBRATE, *where, "--yes"])
    said = capsys.readouterr()
    assert code == 0, said.err
    assert re.search(r"off the plane of the others: touch a point more", said.err)
    again = re.search(
        r"touch ([\d or]+) is (\d+\.\d) mm off the plane of the others: touch there again", said.err
    )
    assert again, said.err
    assert "2" in again[1].split(" or ")
    assert "is the ceiling flat there?" not in said.err
    height = json.loads(said.out)["ceiling"]["height"]
    assert abs(height["value"] - RoomGeometry().ceiling_z) < height["u95"] < 2e-3


@pytest.mark.soak
def test_a_check_that_a_rule_refuses_is_not_judged(
    room: Path,
    measured: tuple[dict[str, Any], LabFile],
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    wrong = ("--lab", str(room / "found" / "lab-before.toml"))
    code, found = perchhw(capsys, "check", "hover", *wrong, "--seconds", "5", "--out", str(tmp_path))
    assert (code, found["same"]) == (3, None)
    assert found["aborted_by"]
    assert not (tmp_path / "hover-checks").exists()


@pytest.mark.soak
def test_the_height_of_a_standing_drone_is_that_of_the_simulation() -> None:
    from calibration.room.standing import HEIGHT_SIGMA, standing_height
    from onboard.room import RoomGeometry
    from sim_backend.physics.parameters import physics_parameters
    from sim_backend.physics.reset import resting_on_floor

    for name in (FILE, "crazyflie21-stock"):
        vehicle = load_vehicle(name)
        rests = resting_on_floor(physics_parameters(vehicle, RoomGeometry()), 0.0, 0.0, 0.0)
        assert standing_height(vehicle) == pytest.approx(float(rests["position"][2]), abs=HEIGHT_SIGMA)


LAB = """schema = "perchhw.lab/1"

[room]
ceiling = { height = 2.1, tilt_x_deg = 0.0, tilt_y_deg = 0.0 }
x_min = -6.5
x_max = 2.0
y_min = -1.0
y_max = 1.0
floor = 0.0
start = { x = -2.5, y = 0.0, yaw_deg = 0.0 }

[[drones]]
uri = "udp://127.0.0.1:1"
vehicle = "crazyflie21-upgraded"
subject = "cf1"

[mocap]
uri = "vicon://127.0.0.1:1"
subject = "cf1"
"""


def test_who_interrupts_it_is_told_that_it_goes_on(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "found"

    def interrupted(*_arguments: Any) -> None:
        out.mkdir(exist_ok=True)
        (out / "state.json").write_text("{}", encoding="utf-8")
        raise KeyboardInterrupt

    monkeypatch.setattr("perchhw.mocap_calibration.session.calibrate_room", interrupted)
    (tmp_path / "lab.toml").write_text(LAB, encoding="utf-8")
    assert run([*CALIBRATE, "--lab", str(tmp_path / "lab.toml"), "--out", str(out), "--yes"]) == 130
    on = f"the steps that are done are kept: the same command with --out {out} goes on"
    assert on in capsys.readouterr().err
