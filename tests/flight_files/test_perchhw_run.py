"""Our own records as flights."""

import math
from pathlib import Path

import numpy as np
import pytest

from calibration.flights import PoseSource, UnusableFlightError, open_flight
from perchhw.record import RunRecorder

POSE = {"x": 0.1, "y": 0.2, "z": 1.5, "qx": 0.0, "qy": 0.0, "qz": 0.0, "qw": 1.0}


def test_topics_become_channels_on_one_time_column(tmp_path: Path) -> None:
    config = {"speed_m_s": 2.5, "angle_deg": 40, "ceiling_z": 2.1}
    with RunRecorder(tmp_path / "run", config) as recorder:
        recorder.write("pose", 1.00, {**POSE, "frame": 1, "verdict": "OK"})
        recorder.write("rates", 1.00, {"gx": 1.0, "gy": 2.0, "gz": 3.0})
        recorder.write("rates", 1.01, {"gx": 1.5, "gy": 2.5, "gz": 3.5})
        recorder.write("pose", 1.02, {"x": None, "y": None, "z": None, "frame": 3, "verdict": "OCCLUDED"})
        recorder.write("pose", 1.03, {**POSE, "frame": 4, "verdict": "JUMPED"})
        recorder.write("cues", 1.03, {"tau": math.inf, "theta_x": 0.0, "d_ceil": 0.6, "state": 2})
        recorder.write("estimate", 1.03, {"x": 0.11, "vx": 1.0, "vy": 0.0, "vz": 2.0})
    flight = open_flight(tmp_path / "run")
    assert (flight.format, flight.pose_source, flight.finished) == ("perchhw", PoseSource.MOCAP, True)
    assert (flight.commanded_speed, flight.commanded_angle_deg, flight.ceiling_z) == (2.5, 40.0, 2.1)
    assert flight.t.tolist() == [1.0, 1.01, 1.02, 1.03]
    assert flight.series("z")[0].tolist() == [1.0]  # occluded and jumped poses are not valid
    assert flight.data["z"][3] == 1.5  # but can be looked at
    assert flight.series("gy")[1].ravel().tolist() == [2.0, 2.5]
    assert np.isinf(flight.data["tau"][3])
    assert flight.series("est_x", "vz")[1].tolist() == [[0.11, 2.0]]
    assert flight.trigger is None
    assert flight.data["triggered"].tolist() == [0.0] * 4


def test_the_trigger_is_put_at_the_drones_own_time(tmp_path: Path) -> None:
    with RunRecorder(tmp_path / "run", {}) as recorder:
        for i in range(50):  # drone time runs 3 s behind the host's; receipt is 5 to 12 ms late
            late = 0.005 + 0.001 * (i % 8)
            drone_ms = 7000 + 10 * i
            t = 10.0 + 0.01 * i + late
            recorder.write("rates", t, {"gx": 0.0, "gy": 0.0, "gz": 0.0, "drone_time_ms": drone_ms})
        recorder.write("trigger", 12.0, {"tick_ms": 7300, "count": 1, "tau": 0.23})
    flight = open_flight(tmp_path / "run")
    assert flight.trigger is not None
    assert flight.trigger.t == pytest.approx(10.305, abs=1e-6)
    assert flight.trigger.snapshot == {"tau": 0.23}


def test_a_killed_flight_tells_its_trigger_by_the_drones_state(tmp_path: Path) -> None:
    recorder = RunRecorder(tmp_path / "run", {})
    for i, state in enumerate((2, 2, 3, 3, 4)):
        recorder.write("cues", 0.1 * i, {"state": state})
    flight = open_flight(tmp_path / "run")  # never closed
    assert not flight.finished
    assert flight.trigger is not None
    assert flight.trigger.t == pytest.approx(0.2)
    assert any("not finished" in note for note in flight.notes)
    recorder.event("phase", 0.5, phase="done")
    assert open_flight(tmp_path / "run").finished
    recorder.close()


def test_who_aborted_it(tmp_path: Path) -> None:
    with RunRecorder(tmp_path / "a", {}) as recorder:
        recorder.write("pose", 0.0, {**POSE, "verdict": "ok"})
        recorder.event("phase", 0.1, phase="landing", aborted_by="pose_stale")
    assert open_flight(tmp_path / "a").aborted_by == "pose_stale"
    with RunRecorder(tmp_path / "b", {}) as recorder:
        recorder.write("pose", 0.0, {**POSE, "verdict": "ok"})
        recorder.close(aborted_by="operator")
    assert open_flight(tmp_path / "b").aborted_by == "operator"


def test_an_empty_record_is_unusable(tmp_path: Path) -> None:
    with RunRecorder(tmp_path / "run", {}) as recorder:
        recorder.event("refused", 0.0, reason="no drone")
    with pytest.raises(UnusableFlightError, match="holds no pose"):
        open_flight(tmp_path / "run")
