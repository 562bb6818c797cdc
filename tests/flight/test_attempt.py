"""Whole attempts over the real protocols against the simulated lab: landings, refusals, sudden deaths."""

import json
import os
import signal
import subprocess
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from calibration.flights import open_flight
from onboard.arrays import FloatArray
from onboard.errors import InputError, PerchhwError
from onboard.link import DroneLink, reboot
from perchhw.attempt import STORED_VEHICLE, AttemptRequest, AttemptResult, Outcome
from perchhw.cli.main import run
from perchhw.diagnosis import Cause, diagnose_run
from perchhw.flight import fly_attempt
from perchhw.flight.turnaround import Turnaround
from perchhw.lab_process import FREE_PORTS, LOCKSTEP, SimulatedLab
from perchhw.record import read_run
from perchhw.supervisor import FlightState, Phase
from sim_backend.engine_name import usable_engine


def open_lab(*arguments: str) -> SimulatedLab:
    return SimulatedLab("lab", (*FREE_PORTS, *LOCKSTEP, "--seed", "7", *arguments))


@pytest.fixture(scope="module")
def lab(tmp_path_factory: pytest.TempPathFactory) -> Iterator["Watched"]:
    truth = tmp_path_factory.mktemp("lab") / "truth.csv"
    with open_lab("--truth", str(truth)) as lab:
        yield Watched(lab, truth)


class Watched:
    """A lab in which one test after another flies, and the truth of each of them."""

    def __init__(self, lab: SimulatedLab, truth: Path) -> None:
        self.drones, self.mocap, self._truth = lab.drones, lab.mocap, truth
        self._seen = 0

    @contextmanager
    def flown(self) -> Iterator[None]:
        """What is flown within it; then the drone is put back on its mark, wherever it is."""
        self._seen = len(self._truth.read_text().splitlines())
        try:
            yield
        finally:
            reboot(self.drones[0], even_flying=True)

    def truth(self, *names: str) -> list[FloatArray]:
        """Columns of what was flown."""
        header, *lines = self._truth.read_text().splitlines()
        rows = [line.split(",") for line in lines[self._seen :]]
        columns = header.split(",")
        whole = [row for row in rows if len(row) == len(columns)]
        return [np.array([row[columns.index(name)] for row in whole], dtype=float) for name in names]


def request(lab: SimulatedLab | Watched, folder: Path, **changes: Any) -> AttemptRequest:
    values: dict[str, Any] = {
        "speed": 2.5,
        "angle_deg": 52.5,
        "index": 0,
        "folder": folder,
        "drone": lab.drones[0],
        "mocap": lab.mocap[0],
        "policy": "default",
        "vehicle": "crazyflie21-upgraded",
    }
    return AttemptRequest(**{**values, **changes})


def told(result: AttemptResult) -> str:
    """The cause that the attempt's diagnosis names."""
    assert result.diagnosis is not None
    assert result.diagnosis == read_run(result.record).info["diagnosis"]
    return str(result.diagnosis["code"])


def refused(lab: SimulatedLab | Watched, folder: Path, **changes: Any) -> AttemptResult:
    """An attempt that must not arm: the record must show that it never did."""
    phases: list[Phase] = []
    result = fly_attempt(request(lab, folder, **changes), on_phase=lambda state: phases.append(state.phase))
    assert result.outcome is Outcome.ABORTED
    assert result.aborted_by is not None
    assert Phase.TAKING_OFF not in phases
    return result


def test_an_attempt_lands_and_its_record_tells_the_whole_story(tmp_path: Path) -> None:
    truth = tmp_path / "truth.csv"
    with open_lab("--truth", str(truth), "--vehicle", STORED_VEHICLE) as lab:  # whose feet always hold
        result = fly_attempt(request(lab, tmp_path / "run", vehicle=STORED_VEHICLE))
    rows = truth.read_text().splitlines()
    last_row = dict(zip(rows[0].split(","), rows[-1].split(","), strict=True))
    feet = int(last_row["legs_attached"])
    held = {Outcome.FOUR_LEG: (3, 4), Outcome.FOUR_LEG_BODY_CONTACT: (3, 4)}.get(result.outcome, (1, 2))
    assert feet in held, f"labelled {result.outcome}, but {feet} feet hold"
    assert result.triggered, result
    assert result.outcome.attached, result
    assert told(result).startswith("four_legs" if feet > 2 else "two_legs")
    assert result.trigger is not None
    assert 0.05 < result.trigger["tau"] < 0.4
    assert result.trigger["trigger_value"] >= 0.0
    assert result.trigger["a_rot"] < 0.0

    run = read_run(result.record)
    assert run.info["outcome"] == result.outcome
    assert run.info["triggered"] is True
    assert run.info["engine"] == usable_engine(None)
    events = [event["phase"] for event in run.events if event["event"] == "phase"]
    assert events[0] == "checking"
    assert events[-1] == "done"
    flight = open_flight(result.record)
    assert float(np.nanmax(flight.data["z"])) > 1.9


@pytest.mark.soak  # tests/docs/test_flight_day.py flies again in the same way
def test_a_drone_that_was_put_back_flies_again(lab: Watched, tmp_path: Path) -> None:
    results = []
    for number in range(2):
        results.append(fly_attempt(request(lab, tmp_path / f"run-{number}", speed=2.25, angle_deg=52.5)))
        Turnaround(lab.drones[0], confirm=lambda _what: None).put_back()
    assert all(result.triggered for result in results)


def test_a_dry_run_uploads_the_policy_and_never_arms(lab: Watched, tmp_path: Path) -> None:
    phases: list[Phase] = []
    result = fly_attempt(
        request(lab, tmp_path / "run"), dry_run=True, on_phase=lambda state: phases.append(state.phase)
    )
    assert result.aborted_by is None
    assert told(result) == "dry_run"
    assert phases == [Phase.CHECKING, Phase.UPLOADING, Phase.DONE]


@pytest.mark.further
def test_a_wrong_subject_name_does_not_arm(lab: Watched, tmp_path: Path) -> None:
    wrong = lab.mocap[0].replace("subject=", "subject=not-")
    result = refused(lab, tmp_path / "run", mocap=wrong)
    assert "pose" in str(result.aborted_by)


def test_no_mocap_does_not_arm(lab: Watched, tmp_path: Path) -> None:
    result = refused(lab, tmp_path / "run", mocap="vicon://127.0.0.1:9?subject=cf1")
    assert "pose" in str(result.aborted_by)


@pytest.mark.usefixtures("own_drone_files")
def test_no_drone_is_an_error_and_the_record_says_why(lab: Watched, tmp_path: Path) -> None:
    with pytest.raises(PerchhwError, match=r"127\.0\.0\.1:9"):
        fly_attempt(request(lab, tmp_path / "run", drone="udp://127.0.0.1:9"))
    assert "127.0.0.1:9" in read_run(tmp_path / "run").info["aborted_by"]


@pytest.mark.parametrize(
    "changes", [{"drone": "foo://1"}, {"mocap": "vicon://"}, {"policy": "no-such-policy"}]
)
def test_input_that_cannot_be_used_leaves_no_record(
    changes: dict[str, str], lab: Watched, tmp_path: Path
) -> None:
    with pytest.raises(InputError):
        fly_attempt(request(lab, tmp_path / "run", **changes))
    assert not (tmp_path / "run").exists()


@pytest.mark.further  # poses that do not come do not arm either, above
def test_frozen_poses_do_not_arm(tmp_path: Path) -> None:
    with open_lab("--fault", "mocap_freeze_at=0") as lab:
        result = refused(lab, tmp_path / "run")
    assert "pose" in str(result.aborted_by)
    assert told(result) == "mocap_frozen"


def fly_in_child(lab: SimulatedLab | Watched, folder: Path) -> "subprocess.Popen[str]":
    """`perchhw fly` as a process of its own."""
    arguments = ["--drone", lab.drones[0], "--mocap", lab.mocap[0], "--speed", "2.5", "--angle", "60"]
    return subprocess.Popen(
        [sys.executable, "-m", "perchhw", "--json", "fly", *arguments, "--out", str(folder)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


def wait_for_phase(process: "subprocess.Popen[str]", phase: str) -> None:
    """Read the child's progress until it enters `phase`."""
    assert process.stderr is not None
    for line in process.stderr:
        if phase in line:
            return
    pytest.fail(f"the flight ended before it was {phase}")


def only_run(folder: Path) -> Path:
    (run,) = folder.iterdir()
    return run


@pytest.mark.parametrize("victim", ["lab", pytest.param("room", marks=pytest.mark.soak)])
def test_a_drone_or_room_that_dies_on_the_approach_ends_the_attempt(victim: str, tmp_path: Path) -> None:
    with open_lab() as lab:
        processes = lab.ready["processes"]
        died = threading.Event()

        def kill_on_approach(state: FlightState) -> None:
            if state.phase is Phase.APPROACHING and not died.is_set():
                os.kill(processes[victim], signal.SIGKILL)
                died.set()

        result = fly_attempt(request(lab, tmp_path / "run"), on_phase=kill_on_approach)
    assert died.is_set()
    assert result.outcome is Outcome.ABORTED, result
    assert ("pose" if victim == "room" else "link") in str(result.aborted_by)
    assert told(result) == ("mocap_silent" if victim == "room" else "link_lost")
    run = read_run(tmp_path / "run")
    assert run.info["closed"] is True
    killed_at = next(e["t"] for e in run.events if e["event"] == "phase" and e["phase"] == "approaching")
    topic = "pose" if victim == "room" else "estimate"
    assert abs(float(run.series[topic].t[-1]) - killed_at) < 0.2


@pytest.mark.soak
@pytest.mark.parametrize(
    ("how", "why"), [(signal.SIGKILL, "link_lost"), (signal.SIGSTOP, "it hangs, or is stopped")]
)
def test_who_flies_in_a_lab_that_dies_or_hangs_is_told_and_keeps_the_record(
    how: signal.Signals, why: str, tmp_path: Path
) -> None:
    with open_lab() as lab:
        process = fly_in_child(lab, tmp_path)
        wait_for_phase(process, "moving to start")
        os.kill(lab.pid, how)
        output, errors = process.communicate(timeout=300)
        os.kill(lab.pid, signal.SIGCONT)
    assert process.returncode == 3, errors
    assert why in errors
    assert "MOTORS CUT BEFORE IT WAS DOWN" in errors
    assert "STOP NOT CONFIRMED" in errors
    assert "Traceback" not in errors
    assert json.loads(output)["diagnosis"]["code"] == "link_lost"
    run = read_run(only_run(tmp_path))
    assert run.info["closed"] is True
    assert run.info["fell"] is not None


@pytest.mark.further
def test_a_flight_killed_on_the_approach_loses_nothing_but_its_last_instant(
    lab: Watched, tmp_path: Path
) -> None:
    with lab.flown():
        process = fly_in_child(lab, tmp_path)
        wait_for_phase(process, "approaching")
        process.kill()
        process.communicate()
    run = read_run(only_run(tmp_path))
    assert diagnose_run(run).cause is Cause.PROCESS_KILLED
    approaching = next(e["t"] for e in run.events if e.get("phase") == "approaching")
    assert approaching - float(run.series["pose"].t[-1]) < 0.05


def assert_landed_softly(lab: Watched) -> None:
    z, vz, feet = lab.truth("z", "vz", "legs_attached")
    assert z.max() > 0.4, "it did not fly"
    assert z[-1] < 0.15, "the drone is not on the floor"
    assert feet.max() == 0
    falling = vz[z < z.max() - 0.1]
    assert falling.min() > -1.5, f"it came down at {falling.min():.1f} m/s"


@pytest.mark.parametrize("phase", [pytest.param("moving to start", marks=pytest.mark.soak), "approaching"])
def test_ctrl_c_in_the_air_lands_stops_the_motors_and_exits_130(
    phase: str, lab: Watched, tmp_path: Path
) -> None:
    with lab.flown():
        process = fly_in_child(lab, tmp_path / "runs")
        wait_for_phase(process, phase)
        process.send_signal(signal.SIGINT)
        output, errors = process.communicate(timeout=200)
        assert_landed_softly(lab)
    assert process.returncode == 130, errors
    assert json.loads(output)["aborted_by"] == "operator"
    run = read_run(only_run(tmp_path / "runs"))
    assert run.info["closed"] is True
    assert run.info["aborted_by"] == "operator"


@pytest.mark.soak  # without a flight: tests/screen/test_lines.py
def test_a_display_that_closes_in_the_air_ends_no_flight(lab: Watched, tmp_path: Path) -> None:
    """``perchhw fly ... 2>&1 | head``."""
    with lab.flown(), fly_in_child(lab, tmp_path / "runs") as process:
        wait_for_phase(process, "moving to start")
        assert process.stderr is not None
        process.stderr.close()
        process.wait(timeout=200)
    run = read_run(only_run(tmp_path / "runs"))
    assert run.info["closed"] is True
    assert run.info["aborted_by"] is None
    assert run.info["outcome"] in (Outcome.FOUR_LEG, Outcome.TWO_LEG, Outcome.FAILURE)


@pytest.mark.parametrize("phase", ["taking off", pytest.param("approaching", marks=pytest.mark.soak)])
def test_ctrl_c_twice_stops_the_motors_and_knows_that_they_are_locked(
    phase: str, lab: Watched, tmp_path: Path
) -> None:
    """Also in a lab that keeps its own time, which the stop does not go by."""
    with lab.flown():
        process = fly_in_child(lab, tmp_path / "runs")
        wait_for_phase(process, phase)
        process.send_signal(signal.SIGINT)
        process.send_signal(signal.SIGTERM)
        output, errors = process.communicate(timeout=60)
        with DroneLink.open(lab.drones[0]) as link:
            assert link.supervisor_info().is_locked
    assert process.returncode == 130, errors
    assert json.loads(output)["aborted_by"] == "operator"
    events = [event["event"] for event in read_run(only_run(tmp_path / "runs")).events]
    assert "StopConfirmed" in events


@pytest.mark.further
def test_a_trigger_that_does_not_come_ends_on_the_floor(lab: Watched, tmp_path: Path) -> None:
    with lab.flown():
        result = fly_attempt(request(lab, tmp_path / "run", speed=1.5, angle_deg=88.0))
        assert_landed_softly(lab)
    assert (result.outcome, result.aborted_by, result.triggered) == (Outcome.NO_TRIGGER, None, False)
    assert told(result) == "region_missed"


@pytest.mark.further
def test_fly_reports_one_json_document(
    lab: Watched, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    arguments = ["--drone", lab.drones[0], "--mocap", lab.mocap[0], "--speed", "2.5", "--angle", "60"]
    code = run(["fly", *arguments, "--dry-run", "--json", "--out", str(tmp_path)])
    said = capsys.readouterr()
    assert code == 0, said.err
    document = json.loads(said.out)
    assert set(document) >= {"outcome", "triggered", "trigger", "aborted_by", "record"}
    assert document["aborted_by"] is None
