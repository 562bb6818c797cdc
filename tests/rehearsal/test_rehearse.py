"""``perchhw rehearse`` against a simulated lab, over its sockets."""

import csv
import json
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from onboard.app_interface import LandingState, Parameter, Rehearsal
from onboard.firmware.compiler import find_compiler
from onboard.lab_time import open_timebase
from onboard.link import DroneLink
from onboard.policy.files import find_policy, load_policy
from onboard.trajectory import fit_approach
from onboard.vehicle import load_vehicle
from perchhw.attempt import DEFAULT_VEHICLE
from perchhw.cli.main import run
from perchhw.lab import desk_setup
from perchhw.lab_process import FREE_PORTS, LOCKSTEP, SimulatedLab
from perchhw.record.run import read_run
from perchhw.rehearsal import loop_time
from perchhw.rehearsal.physics import Physics
from perchhw.rehearsal.record import COLUMNS, save_rehearsal
from perchhw.rehearsal.session import OnStage, RehearsalStage
from perchhw.rehearsal.session import rehearse as rehearse_in_session
from perchhw.rehearsal.watched import record_in
from sim_backend.engine_name import EngineName, usable_engine
from tests.patience import PATIENCE_S, patient_uri, until
from tests.sim_crazyflie.served_flight import ServedFlight, serve_flight
from tests.sim_crazyflie.simulated_flight import Flight


@contextmanager
def lab(engine: EngineName, *arguments: str) -> Iterator[SimulatedLab]:
    if engine is EngineName.C and find_compiler() is None:
        pytest.skip("no C compiler: the drone's code in C cannot rehearse")
    with SimulatedLab(
        "lab", (*FREE_PORTS, *LOCKSTEP, "--seed", "3", "--engine", engine, *arguments)
    ) as served:
        yield served


@dataclass(frozen=True)
class Desk:
    """A lab in which one approach after another is rehearsed, and the file of its truth."""

    served: SimulatedLab
    truth: Path

    @property
    def drone(self) -> str:
        """Its address."""
        return self.served.drones[0]

    def heights(self) -> list[float]:
        """Of the drone, 100 a second of the lab's time until now."""
        with self.truth.open() as file:
            return [float(row["z"]) for row in csv.DictReader(file) if row["vx"] is not None]


@contextmanager
def desk(engine: EngineName, folder: Path) -> Iterator[Desk]:
    with lab(engine, "--truth", str(folder / "truth.csv")) as served:
        yield Desk(served, folder / "truth.csv")


@pytest.fixture(scope="module")
def lab_desk(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Desk]:
    """Its drone flies what a lab's does by itself: the code in C, where there is a compiler."""
    with desk(usable_engine(None), tmp_path_factory.mktemp("lab")) as one:
        yield one


@pytest.fixture(scope="module")
def reference_desk(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Desk]:
    with desk(EngineName.REFERENCE, tmp_path_factory.mktemp("reference")) as one:
        yield one


def rehearse(uri: str, capsys: pytest.CaptureFixture[str], *arguments: str) -> tuple[int, dict[str, Any]]:
    capsys.readouterr()
    code = run(["rehearse", "--drone", uri, "--json", *arguments])
    said = capsys.readouterr()
    assert said.err.lstrip().startswith("connecting: waits for the drone to answer")
    return code, json.loads(said.out)


@pytest.mark.parametrize("on", Physics)
@pytest.mark.parametrize("whose", ["lab", pytest.param("reference", marks=pytest.mark.further)])
def test_the_papers_approach_passes_and_nothing_moves(
    whose: str,
    on: Physics,
    request: pytest.FixtureRequest,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    """One after the other on the same drone: what the first left behind is there for the second."""
    here: Desk = request.getfixturevalue(f"{whose}_desk")
    engine = usable_engine(None) if whose == "lab" else EngineName.REFERENCE
    before = len(here.heights())
    code, said = rehearse(here.drone, capsys, "--on", on, "--out", str(tmp_path / "out"))
    with open_timebase("test", here.drone) as time, DroneLink.open(here.drone, clock=time) as link:
        assert link.param(Parameter.REHEARSE) == 0
    assert (code, said["pass"], said["failures"]) == (0, True, [])
    assert (said["on"], said["engine"], said["reason"], said["loop_us"]) == (on, engine, "triggered", None)
    assert said["trigger_sample_difference"] == 0
    assert said["a_rot_difference_n_m"] <= 1e-8
    assert said["force_difference_n"] <= 1e-6
    assert 0.0 < said["input_difference"]["position_m"] < (0.3 if on is Physics.HOST else 0.05)
    heights = here.heights()
    assert len(heights) - before > 300
    assert max(heights) - min(heights) < 1e-3
    with (Path(said["record"]) / "ring.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert tuple(rows[0]) == COLUMNS
    assert len(rows) == 140
    assert json.loads((Path(said["record"]) / "verdict.json").read_text())["pass"] is True


@pytest.mark.further
def test_a_view_follows_where_the_drones_own_model_flies(lab_desk: Desk, tmp_path: Path) -> None:
    code, _ = rehearse_on_record(lab_desk.drone, tmp_path / "run", Physics.DRONE)
    assert code == 0
    flown = read_run(tmp_path / "run").series
    assert np.nanmax(flown["estimate"].numbers("z")) > 1.2
    assert np.nanmax(flown["cues"].numbers("trigger_value")) >= 0.0
    assert "pose" not in flown, "nobody sends poses"


def rehearse_on_record(uri: str, folder: Path, physics: Physics = Physics.HOST) -> tuple[int, dict[str, Any]]:
    """As the command does with ``--view``, but for the viewer."""
    setup = desk_setup(None, drone=uri, vehicle=None, policy=None)
    plan = fit_approach(2.5, 50.0, setup.room)
    policy, vehicle = load_policy(find_policy(setup.policy)), load_vehicle(setup.vehicle, setup.legs)
    rehearsal = rehearse_in_session(
        setup.drone, plan, policy, vehicle, record_in(folder, {}), physics=physics
    )
    save_rehearsal(folder.parent, rehearsal, folder)
    return int(not rehearsal.verdict.passed), json.loads((folder / "verdict.json").read_text())


@pytest.mark.soak
def test_a_lab_in_lock_step_gives_the_same_verdict_again_also_on_record(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Poses and answers of one ms may come to the drone in either order: its inputs move by a ms at most."""
    said, inputs = [], []
    for on_record in (False, True):
        with lab(EngineName.REFERENCE) as served:
            uri = served.drones[0]
            code, document = rehearse_on_record(uri, tmp_path / "run") if on_record else rehearse(uri, capsys)
        inputs.append(document.pop("input_difference"))
        del document["force_difference_n"]
        said.append((code, document))
    assert said[0] == said[1]
    assert inputs[0] == pytest.approx(inputs[1], rel=0.1, abs=0.01)
    run = read_run(tmp_path / "run")
    cues, poses = run.series["cues"], run.series["pose"]
    assert {LandingState.APPROACH, LandingState.FLIP} <= set(cues.numbers("state"))
    assert np.nanmax(cues.numbers("trigger_value")) >= 0.0  # it fired
    assert np.diff(poses.t) == pytest.approx(0.01, abs=0.002)
    assert run.series["estimate"].numbers("z").max() > 1.0
    assert run.closed


@pytest.mark.further  # test_own_model.py changes one without a lab
@pytest.mark.parametrize("engine", EngineName)
def test_one_weight_changed_in_the_drones_memory_fails(
    engine: EngineName, capsys: pytest.CaptureFixture[str]
) -> None:
    with lab(engine, "--fault", "policy_weight=1.01") as served:
        for on in Physics:
            code, said = rehearse(served.drones[0], capsys, "--on", on)
            assert "error" not in said, said
            assert (code, said["pass"], said["on"]) == (1, False, on)
            assert any("moment differs" in failure for failure in said["failures"])


@pytest.mark.further
def test_an_approach_on_which_the_policy_does_not_fire_fails(
    lab_desk: Desk, capsys: pytest.CaptureFixture[str]
) -> None:
    code, said = rehearse(lab_desk.drone, capsys, "--speed", "0.5", "--angle", "30")
    assert (code, said["pass"], said["trigger_sample_difference"]) == (1, False, None)
    assert any("the drone did not trigger" in failure for failure in said["failures"])


@contextmanager
def on_the_desk() -> Iterator[ServedFlight]:
    with serve_flight(Flight(seed=1, vehicle=load_vehicle(DEFAULT_VEHICLE))) as served:
        yield served


def test_an_armed_drone_is_refused_by_safety(capsys: pytest.CaptureFixture[str]) -> None:
    with on_the_desk() as served:
        served.call(served.flight.arm)
        code, said = rehearse(patient_uri(served.uri), capsys)
        assert served.call(lambda: served.flight.firmware.supervisor.is_armed), "and left as it was"
    assert code == 3
    assert "it must be disarmed, on the ground, with all motors still" in said["error"]


def test_a_drone_with_another_configuration_is_refused_and_the_doctor_named(
    capsys: pytest.CaptureFixture[str],
) -> None:
    """A reboot alone does not help there."""
    with on_the_desk() as served:
        served.call(lambda: served.flight.write("powerDist.idleThrust", 7000))
        code, said = rehearse(patient_uri(served.uri), capsys)
    assert code == 3
    assert "configured as the app needs it" in said["error"]
    assert "perchhw doctor" in said["error"]


def test_what_a_processor_says_of_its_loop_is_told(
    lab_desk: Desk, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """The simulated drone has none: its battery, in mV, says something in its place."""
    monkeypatch.setattr(loop_time, "LOOP_TIME", "pm.vbatMV")
    _, said = rehearse(lab_desk.drone, capsys, "--on", Physics.DRONE)
    assert "error" not in said, said
    assert 3700.0 < said["loop_us"]["mean"] <= said["loop_us"]["most"] < 4400.0


def test_an_interrupt_switches_the_mode_off() -> None:
    with on_the_desk() as served:

        def rehearses() -> bool:
            app = served.flight.firmware.app
            return app is not None and app.rehearses

        command = [sys.executable, "-m", "perchhw", "rehearse", "--drone", patient_uri(served.uri)]
        with subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) as process:
            until(lambda: served.call(rehearses))
            process.send_signal(signal.SIGINT)
            assert process.wait(PATIENCE_S) == 130
        assert not served.call(rehearses)


def test_a_rehearsal_whose_host_died_in_the_approach_is_ended_before_the_next_one_arms() -> None:
    with on_the_desk() as served:
        uri = patient_uri(served.uri)
        command = [sys.executable, "-m", "perchhw", "rehearse", "--drone", uri, "--on", Physics.DRONE]
        with subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) as process:
            until(lambda: served.call(lambda: served.flight.param(Parameter.STATE)) == LandingState.APPROACH)
            process.kill()
        until(lambda: served.call(lambda: served.flight.param(Parameter.STATE)) != LandingState.APPROACH)
        assert served.call(lambda: served.flight.param(Parameter.REHEARSE)) == Rehearsal.MODEL
        states = []

        def look(stage: RehearsalStage, _waits_for: str) -> None:
            states.append((stage, served.call(lambda: served.flight.param(Parameter.STATE))))
            if stage is RehearsalStage.APPROACHING:
                raise KeyboardInterrupt  # by the operator: the rest is another test's

        with pytest.raises(KeyboardInterrupt):
            rehearse_until(look, uri)
    assert states[-1] == (RehearsalStage.APPROACHING, LandingState.IDLE)


def rehearse_until(on_stage: OnStage, uri: str) -> None:
    """On the drone's own model, while somebody looks at each stage."""
    setup = desk_setup(None, drone=uri, vehicle=None, policy=None)
    plan = fit_approach(2.5, 50.0, setup.room)
    policy, vehicle = load_policy(find_policy(setup.policy)), load_vehicle(setup.vehicle, setup.legs)
    rehearse_in_session(setup.drone, plan, policy, vehicle, on_stage=on_stage, physics=Physics.DRONE)


def test_a_drone_of_another_vehicle_is_refused(capsys: pytest.CaptureFixture[str]) -> None:
    with on_the_desk() as served:
        code, said = rehearse(patient_uri(served.uri), capsys, "--vehicle", "crazyflie21-stock")
    assert code == 1
    assert "was built for another vehicle" in said["error"]


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ((), "--drone: missing"),
        (("--drone", "carrier-pigeon://1"), "carrier-pigeon"),
        (("--drone", "udp://127.0.0.1:9", "--angle", "120"), "angle"),
        (("--drone", "udp://127.0.0.1:9", "--policy", "nobodys"), "nobodys"),
    ],
)
def test_what_cannot_be_used_is_named(
    arguments: tuple[str, ...], words: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(["rehearse", "--json", *arguments]) == 2
    assert words in json.loads(capsys.readouterr().out)["error"]
