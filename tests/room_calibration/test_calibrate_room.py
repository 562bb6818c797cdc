"""``perchhw mocap calibrate`` in a simulated room whose lab file is wrong; then the morning's question there."""

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from calibration.flights import open_flight
from calibration.gap.data import prepare_flights
from onboard.vehicle import load_vehicle
from perchhw.cli.main import run
from perchhw.lab import read_lab
from perchhw.lab_process import FREE_PORTS, LOCKSTEP, SimulatedLab
from tests.hover_check.drones import FILE, GYRO_BIAS, WEAK_MOTOR, drone, effect

TURN, OFFSET, DELAY = np.array([0.05, -0.03, 0.08]), np.array([0.01, -0.02, 0.03]), 0.012
"""Of the tracked frame from the body: rad, m; and s that no source reports."""
HEIGHT, TILT_X, TILT_Y = 2.117, 0.8, -0.5
REPORTED = 0.004


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
    survey = ("--fault", "survey_at=4:3", "--fault", f"survey_ceiling={HEIGHT},{TILT_X},{TILT_Y}")
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


def calibrate(folder: Path, capsys: pytest.CaptureFixture[str], *arguments: str) -> tuple[int, Any]:
    where = ("--lab", str(folder / "lab.toml"), "--out", str(folder / "calibration"))
    return perchhw(capsys, "mocap", "calibrate", *where, "--within", "20", *arguments)


@pytest.mark.timeout(180)
def test_a_room_with_wrong_values_is_recovered_within_the_uncertainty(
    room: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    before = read_lab(room / "lab.toml")
    code, found = calibrate(room, capsys)
    assert code == 0, found
    rotation = Rotation.from_rotvec(-TURN)
    position = -rotation.apply(OFFSET)
    seen = found["subject_to_body"]
    for one, truth in zip(seen["position"], position, strict=True):
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

    lab = read_lab(room / "lab.toml")
    assert (lab.drones, lab.room.start, lab.mocap.uri) == (before.drones, before.room.start, before.mocap.uri)
    assert lab.room.ceiling.tilt_x_deg.value == found["ceiling"]["tilt_x_deg"]["value"]
    assert lab.mocap.latency_s.sigma > 0.0
    text = (room / "lab.toml").read_text(encoding="utf-8")
    assert text.startswith("# Written by")
    assert "# a remark" in text
    assert read_lab(room / "calibration" / "lab-before.toml") == before

    # Done steps are not done again: nobody comes to the room any more.
    again, same = calibrate(room, capsys, "--dry-run")
    assert (again, same["written"]) == (0, False)
    assert same["subject_to_body"] == seen


@pytest.mark.timeout(180)
def test_in_a_measured_room_the_check_names_what_the_drone_has(
    room: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = ("--seconds", "5", "--out", str(room / "runs"))
    code, found = perchhw(capsys, "check", "hover", "--lab", str(room / "lab.toml"), *out)
    assert (code, found["same"], found["changed"]) == (1, False, []), found
    assert found["off_file"] == ["motor_2", "gyro_bias_x"]
    lines = {line["what"]: line for line in found["lines"]}
    assert abs(lines["motor_2"]["measured"]["value"] - 1.0 / 0.86) < 0.01
    assert abs(lines["gyro_bias_x"]["measured"]["value"] - 0.03) < 0.001
    assert "calibrate tachometer" in lines["motor_2"]["settles"]
    assert Path(found["kept"]).is_file()

    (record,) = prepare_flights([open_flight(Path(found["record"]))]).records
    assert record.specific_force is not None
    assert record.flying.sum() * record.dt > 12.0


def test_without_a_hand_the_step_says_what_it_waits_for(
    room: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    where = ("--lab", str(room / "lab.toml"), "--out", str(tmp_path / "other"), "--within", "6")
    code, document = perchhw(capsys, "mocap", "calibrate", *where)
    assert code == 2
    assert "not seen within 6 s: the drone rests 0 deg from its first heading; turn it" in document["error"]
    assert "rest_1" in (tmp_path / "other" / "state.json").read_text(encoding="utf-8")


def test_the_height_of_a_standing_drone_is_that_of_the_simulation() -> None:
    from calibration.room.standing import HEIGHT_SIGMA, standing_height
    from onboard.room import RoomGeometry
    from sim_backend.physics.parameters import physics_parameters
    from sim_backend.physics.reset import resting_on_floor

    for name in (FILE, "crazyflie21-stock"):
        vehicle = load_vehicle(name)
        rests = resting_on_floor(physics_parameters(vehicle, RoomGeometry()), 0.0, 0.0, 0.0)
        assert standing_height(vehicle) == pytest.approx(float(rests["position"][2]), abs=HEIGHT_SIGMA)
