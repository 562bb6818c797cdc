"""The world around the drones: operator, batteries, faults, lost time, truth."""

import csv
import math
from dataclasses import replace
from itertools import combinations
from pathlib import Path

import numpy as np
import pytest

from onboard.gravity import GRAVITY
from onboard.room import RoomGeometry
from onboard.vehicle import load_vehicle
from onboard.vehicle.unnamed import UnnamedCurve
from sim_backend.fault_values import FaultError
from sim_backend.faults import fault_table, parse_faults
from sim_backend.lab_faults import DroneFaults
from sim_backend.room.settings import ROOM_RULES
from sim_backend.truth import COLUMNS, TruthError, TruthRecorder
from sim_backend.world import LAG_LIMIT_S, World, WorldError, start_marks
from tests.sim_crazyflie.simulated_flight import LEGS, VEHICLE, Flight


@pytest.fixture
def world() -> World:
    return World(load_vehicle(VEHICLE, LEGS))


def test_as_many_drones_as_there_may_be_start_within_the_walls_and_apart() -> None:
    room, marks = RoomGeometry(), start_marks(32)
    for mark in marks:
        assert room.x_min + 0.2 <= mark.x <= room.x_max - 0.2
        assert room.y_min + 0.2 <= mark.y <= room.y_max - 0.2
    assert min(math.dist((a.x, a.y), (b.x, b.y)) for a, b in combinations(marks, 2)) >= 0.49


def test_a_reboot_on_the_floor_brings_the_drone_back_with_a_fresh_battery() -> None:
    flight = Flight()
    flight.hover()
    flight.go_to(-1.0, 0.3, 0.5, 2.0)
    flight.run(3.0)
    flight.land()
    flight.run(5.0)
    assert flight.position[0] == pytest.approx(-1.0, abs=0.1)
    used = float(flight.drone.state["charge_used"])
    assert used > 10.0
    flight.firmware.power_off()
    flight.run(0.1)
    flight.firmware.reboot()
    flight.run(0.1)
    mark = flight.drone.mark
    assert flight.position[:2] == pytest.approx([mark.x, mark.y], abs=1e-3)
    assert flight.drone.placements == 1
    assert flight.drone.state["charge_used"] < 0.1
    flight.hover()
    assert flight.position[2] == pytest.approx(0.5, abs=0.02)


def test_a_reboot_in_flight_is_followed_by_a_fall_and_then_by_the_operator() -> None:
    flight = Flight()
    flight.hover(1.0)
    flight.firmware.reboot()
    flight.run(0.3)
    assert flight.drone.placements == 0
    assert 0.3 < flight.position[2] < 0.95
    flight.run(5.0, until=lambda: flight.drone.placements == 1)
    assert flight.drone.placements == 1
    flight.run(0.2)
    assert flight.info.can_arm


def test_the_operator_takes_a_perched_drone_from_the_ceiling(world: World) -> None:
    drone = world.drones[0]
    drone.state["position"] = [0.0, 0.0, 2.02]
    drone.state["quaternion"] = [0.0, 1.0, 0.0, 0.0]
    drone.state["velocity"] = [0.0, 0.0, 2.5]  # slow feet do not stick
    world.run(1.0)
    assert drone.state["foot_attached"].any()
    drone.firmware.reboot()
    world.run(0.1)
    assert drone.state["position"][2] < 0.1
    assert not drone.state["foot_attached"].any()
    assert not drone.state["ceiling_contact"]


def test_pads_are_drawn_anew_for_each_placement_and_the_same_for_a_seed() -> None:
    drawn = []
    for seed in (5, 5, 6):
        world = World(load_vehicle(VEHICLE, LEGS), drones=2, seed=seed)
        first = [float(drone.state["pad_deviate"][0]) for drone in world.drones]
        world.drones[0].place_on_start_mark()
        drawn.append((*first, float(world.drones[0].state["pad_deviate"][0])))
    assert drawn[0] == drawn[1]
    assert len({*drawn[0], *drawn[2]}) == 6


def test_fresh_packs_have_the_faults_voltage() -> None:
    world = World(load_vehicle(VEHICLE, LEGS), faults=DroneFaults(battery_voltage=3.5))
    drone = world.drones[0]
    world.run(0.1)
    assert drone.firmware.battery_voltage() == pytest.approx(3.5, abs=0.01)
    drone.firmware.reboot()
    world.run(0.1)
    assert drone.firmware.battery_voltage() == pytest.approx(3.5, abs=0.01)


def test_a_drone_flashed_with_the_map_of_other_motors_misses_its_height() -> None:
    """What the firmware believes drives it; what the drone is moves it."""
    true = load_vehicle(VEHICLE, LEGS)
    stock = load_vehicle("crazyflie21-stock").motors.thrust_map
    heights = []
    for thrust_map in (true.motors.thrust_map, stock):
        flight = Flight(flashed=replace(true, motors=replace(true.motors, thrust_map=thrust_map)))
        flight.hover(0.8)
        heights.append(flight.position[2])
        map_thrust = sum(flight.firmware.engine.thrusts)
        weight = true.body.mass.value * GRAVITY
        assert (map_thrust == pytest.approx(weight, rel=0.05)) == (thrust_map is true.motors.thrust_map)
    assert heights[0] == pytest.approx(0.8, abs=0.02)
    assert abs(heights[1] - 0.8) > 3.0 * abs(heights[0] - 0.8)


def test_a_hovering_drone_leans_against_a_force_without_a_name() -> None:
    """Five hundredths of the weight along world x, wherever it is higher than 0.3 m."""
    vehicle = load_vehicle(VEHICLE, LEGS)
    force = 0.05 * vehicle.body.mass.value * GRAVITY
    breeze = UnnamedCurve(
        channel="world_force_x",
        regressor="z",
        knots=(0.25, 0.3),
        values=(0.0, force),
        sigma=0.0,
        source="test",
    )
    flight = Flight(vehicle=vehicle.with_unnamed([breeze]), flashed=vehicle)
    flight.hover(0.6)
    leans = []
    for _ in range(200):
        flight.run(0.01)
        x, y, z, w = flight.drone.state["quaternion"]
        leans.append(math.atan2(2.0 * (x * z + w * y), 1.0 - 2.0 * (x * x + y * y)))
    assert np.mean(leans) == pytest.approx(-math.atan(0.05), abs=0.01)
    assert flight.position[2] == pytest.approx(0.6, abs=0.05)


def test_drones_stand_apart_and_differ() -> None:
    world = World(load_vehicle(VEHICLE, LEGS), drones=4)
    world.run(0.05)
    places = np.array([drone.state["position"] for drone in world.drones])
    distances = [np.linalg.norm(a - b) for i, a in enumerate(places) for b in places[:i]]
    assert min(distances) > 0.4
    assert len({float(drone.firmware.sensors.acc[0]) for drone in world.drones}) == 4


def test_time_that_was_missed_is_dropped_and_counted(world: World) -> None:
    world.advance(0.02)
    assert world.time == pytest.approx(0.02)
    world.advance(0.02)
    assert world.time == pytest.approx(0.02)
    world.advance(10.0)
    assert world.time == pytest.approx(0.02 + LAG_LIMIT_S)
    assert world.dropped == pytest.approx(10.0 - 0.02 - LAG_LIMIT_S)
    world.advance(10.03)
    assert world.time == pytest.approx(0.05 + LAG_LIMIT_S)


def test_frozen_drone_keeps_its_motors_and_a_dead_one_stops_them() -> None:
    for faults, running in (
        (DroneFaults(freeze_drone_at=6.0), True),
        (DroneFaults(drone_dies_at=6.0), False),
    ):
        flight = Flight(faults=faults)
        flight.hover()
        assert not flight.drone.silent
        tick = flight.run(2.0) and flight.firmware.tick_ms()
        assert tick == pytest.approx(6000, abs=1)
        assert flight.drone.silent
        assert bool(flight.drone._duties.any()) is running


def test_gyro_bias_turns_the_estimate_when_poses_stop() -> None:
    flight = Flight(faults=DroneFaults(gyro_bias=(0.0, 0.0, 0.05)))
    flight.run(2.0)
    flight.poses = False
    flight.run(2.0)
    assert flight.firmware.estimator.roll_pitch_yaw()[2] == pytest.approx(0.1, abs=0.03)


def test_numbers_that_are_no_numbers_stop_the_world(world: World) -> None:
    world.drones[0].state["velocity"][0] = math.nan
    with pytest.raises(WorldError, match="cf1 diverged"):
        world.run(0.02)


def test_truth_has_a_row_every_ten_ms_on_disk_within_a_fifth_of_a_second(tmp_path: Path) -> None:
    path = tmp_path / "deep" / "truth.csv"
    with TruthRecorder(path) as truth:
        world = World(load_vehicle(VEHICLE, LEGS), drones=2, truth=truth)
        world.run(1.0)
        early = path.read_text(encoding="ascii").splitlines()
        assert len(early) >= 1 + 2 * 80
    with path.open(encoding="ascii") as file:
        rows = list(csv.DictReader(file))
    assert ",".join(rows[0]) == COLUMNS
    assert len(rows) == 200
    times = sorted({float(row["t"]) for row in rows})
    assert np.diff(times) == pytest.approx(0.01)
    assert {row["drone"] for row in rows} == {"cf1", "cf2"}
    assert float(rows[-2]["x"]) == pytest.approx(-2.5)
    assert rows[-1]["legs_attached"] == "0"
    with pytest.raises(TruthError, match="--truth"):
        TruthRecorder(tmp_path)


def test_faults_are_read_from_the_command_line() -> None:
    faults = parse_faults(
        ["battery_voltage=3.4", "gyro_bias=0,0.1,0", "mocap_freeze_at=3:0.5", "link_loss=0.01"]
    )
    assert faults.drone.battery_voltage == 3.4
    assert faults.drone.gyro_bias == (0.0, 0.1, 0.0)
    assert faults.drone.link_loss == 0.01
    assert faults.room == {"mocap_freeze_at": "3:0.5"}
    assert parse_faults([]).drone == DroneFaults()


@pytest.mark.parametrize(
    "argument",
    [
        "battery_voltage",
        "battery_voltage=x",
        "battery_voltage=9",
        "link_loss=2",
        "gyro_bias=1,2",
        "gremlins=1",
    ],
)
def test_bad_faults_are_refused_by_name(argument: str) -> None:
    with pytest.raises(FaultError, match=argument.split("=")[0]):
        parse_faults([argument])


def test_every_fault_has_a_line_of_help() -> None:
    assert set(ROOM_RULES) <= set(fault_table())
