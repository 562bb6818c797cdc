"""A test flight over the real protocols in the simulated lab, and what the gap finder gets of it."""

from pathlib import Path

import numpy as np
import pytest

from calibration.flights import open_flight
from calibration.gap.data import prepare_flights
from calibration.gap.data.record import FlightRecord
from calibration.gap.replay.teacher_forcing import teacher_forced
from onboard.errors import InputError
from onboard.manoeuvres import manoeuvre
from onboard.room import RoomGeometry
from onboard.vehicle import load_vehicle
from perchhw.flight.course import CourseRequest, fly_course
from perchhw.lab_process import FREE_PORTS, LOCKSTEP, SimulatedLab
from perchhw.record import read_run
from perchhw.supervisor import Phase
from sim_backend.physics.parameters import physics_parameters

KIND, PARAMETERS = "yaw_steps_with_doublets", {"repeats": 1.0}


def request(folder: Path, drone: str, mocap: str, kind: str = KIND) -> CourseRequest:
    return CourseRequest(
        kind=kind,
        parameters=PARAMETERS,
        folder=folder,
        drone=drone,
        mocap=mocap,
        vehicle="crazyflie21-upgraded",
    )


@pytest.mark.further  # tests/room_calibration flies a longer one
def test_a_test_flight_follows_its_course_and_can_be_analysed(tmp_path: Path) -> None:
    phases: list[Phase] = []
    with SimulatedLab("lab", (*FREE_PORTS, *LOCKSTEP, "--seed", "3")) as lab:
        result = fly_course(
            request(tmp_path / "run", lab.drones[0], lab.mocap[0]),
            on_phase=lambda state: phases.append(state.phase),
        )
    assert result.aborted_by is None
    assert result.diagnosis is not None
    assert result.diagnosis["code"] == "flown"
    assert result.diagnosis["sentence"].startswith(f"{KIND} flown to its end; at most ")
    assert 0.0 < result.diagnosis["values"]["from_course_m"] < 0.2
    assert 3.0 < result.diagnosis["values"]["lowest_v"] < 4.2
    assert phases[-4:] == [Phase.TEST_FLIGHT, Phase.LANDING, Phase.DISARMING, Phase.DONE]
    assert Phase.UPLOADING not in phases

    run = read_run(tmp_path / "run")
    assert run.info["outcome"] == "flown"
    assert run.config["parameters"]["repeats"] == PARAMETERS["repeats"]
    begin, end = (
        next(e["t"] for e in run.events if e["event"] == "phase" and e["phase"] == phase)
        for phase in ("test flight", "landing")
    )
    course = manoeuvre(KIND).course(PARAMETERS, RoomGeometry())
    assert end - begin == pytest.approx(course.duration, abs=0.5)
    pose = run.series["pose"]
    flying = (pose.t > begin) & (pose.t < begin + course.duration)
    for axis, name in enumerate("xyz"):
        wanted = np.interp(pose.t[flying] - begin, course.t, course.position[:, axis])
        assert np.nanmax(np.abs(pose.numbers(name)[flying] - wanted)) < 0.15
    for topic, field in (("rates", "gx"), ("acceleration", "az"), ("motors", "m1"), ("power", "vbat")):
        numbers = run.series[topic].numbers(field)
        assert np.isfinite(numbers).sum() / (pose.t[-1] - pose.t[0]) > 80.0, topic

    (record,) = prepare_flights([open_flight(tmp_path / "run")]).records
    assert record.specific_force is not None
    assert record.voltage is not None
    assert record.flying.sum() * record.dt > course.duration
    assert_the_commands_tell_the_rates(record)


def assert_the_commands_tell_the_rates(record: FlightRecord) -> None:
    """The logged commands give the measured angular accelerations. Those of single instants do not: poses and
    setpoints come as often as the log, and their jolts stood in it without their answers (slope 0.58)."""
    vehicle = load_vehicle("crazyflie21-upgraded")
    told = teacher_forced(record, physics_parameters(vehicle, RoomGeometry())).angular_acceleration
    turned = np.diff(record.rate, axis=0) / record.dt
    known = record.flying[:-1] & np.isfinite(turned).all(axis=1)
    for axis in range(2):
        assert np.polyfit(told[known, axis], turned[known, axis], 1)[0] == pytest.approx(1.0, abs=0.15)
        assert np.std((turned - told)[known, axis]) < 0.5 * np.std(turned[known, axis])


def test_a_flight_that_cannot_be_flown_leaves_no_record(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="not a kind of test flight"):
        fly_course(request(tmp_path / "run", "udp://127.0.0.1:9", "vicon://127.0.0.1:9?subject=cf1", "loops"))
    assert not (tmp_path / "run").exists()
