"""What the gyro tells of a bare motor that is started and stopped, by the physics of the simulated drone."""

import math

import numpy as np
import pytest

from onboard.vehicle import load_vehicle
from perchhw.bringup.motors import DIRECTIONS, PERIOD_S, STEP, TURNS, judge
from perchhw.bringup.reaction import LEAST, Reaction, reaction
from perchhw.doctor import CheckVerdict
from sim_backend.fault_values import Window
from sim_backend.hung import ROTOR_INERTIA, SPEED_PER_VOLT
from sim_backend.lab_faults import DroneFaults
from sim_backend.world import World

VEHICLE = "crazyflie21-upgraded"
HUNG = Window(0.0)
PERIOD_MS = round(1000 * PERIOD_S)


def felt(motor: int, faults: DroneFaults) -> Reaction:
    """Spin a motor as ``bringup`` does, and log at 100 Hz."""
    world = World(load_vehicle(VEHICLE), faults=faults)
    firmware = world.drones[0].firmware
    world.run(0.5)
    rows = []
    for turn in range(1 + 2 * TURNS):
        firmware.motor_override[motor] = 256 * STEP
        firmware.motor_override[0] = turn % 2
        for ms in range(PERIOD_MS):
            world.step()
            if ms % 10 == 0:
                rows.append((world.time, firmware.logs["gyro.z"], firmware.logs[f"motor.m{motor}"]))
    times, rates, ratios = np.array(rows).T
    return reaction(times, rates, ratios > 0)


@pytest.mark.parametrize("motor", DIRECTIONS)
def test_of_a_drone_on_a_thread_the_gyro_tells_which_way_each_motor_turns(motor: int) -> None:
    answer = felt(motor, DroneFaults(hung_at=HUNG))
    assert answer.direction == DIRECTIONS[motor]
    body = load_vehicle(VEHICLE).body.inertia_zz.value
    frictionless = math.degrees(ROTOR_INERTIA * SPEED_PER_VOLT * 4.1 * STEP / 256 / body)
    assert abs(answer.step) == pytest.approx(frictionless, rel=0.2)
    assert answer.error < 0.1 * frictionless


def test_faults_of_direction_are_found() -> None:
    assert felt(3, DroneFaults(hung_at=HUNG, motor_reversed=3)).direction == "cw"
    swapped = DroneFaults(hung_at=HUNG, motors_swapped=(1, 2))
    assert (felt(1, swapped).direction, felt(2, swapped).direction) == ("cw", "ccw")


def test_where_a_motor_is_the_gyro_does_not_tell() -> None:
    """A torque is the same everywhere: two of the same direction, exchanged, are for the operator to see."""
    assert felt(1, DroneFaults(hung_at=HUNG, motors_swapped=(1, 3))).direction == DIRECTIONS[1]


def test_of_a_drone_that_stands_it_tells_nothing() -> None:
    answer = felt(2, DroneFaults())
    assert answer.direction is None
    assert abs(answer.step) < LEAST


def test_a_hand_that_shakes_is_not_taken_for_a_motor() -> None:
    """5 deg/s rms, correlated over 0.3 s."""
    rng = np.random.default_rng(0)
    times = 0.01 * np.arange((1 + 2 * TURNS) * 60)
    driven = (np.arange(len(times)) // 60) % 2 == 1
    keep = math.exp(-0.01 / 0.3)
    told = 0
    for _ in range(300):
        rates = np.zeros(len(times))
        for i, push in enumerate(5.0 * math.sqrt(1.0 - keep**2) * rng.standard_normal(len(times) - 1)):
            rates[i + 1] = keep * rates[i] + push
        told += reaction(times, rates, driven).direction is not None
    assert told <= 3


def test_a_recording_that_breaks_off_tells_nothing() -> None:
    times = 0.01 * np.arange(150)
    driven = (times > 0.6) & (times < 1.2)
    assert reaction(times, -5.0 * driven, driven).direction is None


@pytest.mark.parametrize(
    ("said", "told", "verdict"),
    [
        ("1 ccw", None, CheckVerdict.FINE),
        ("1", "ccw", CheckVerdict.FINE),
        (" 1 CCW ", "ccw", CheckVerdict.FINE),
        ("1", None, CheckVerdict.UNKNOWN),
        ("1", "cw", CheckVerdict.BAD),
        ("1 ccw", "cw", CheckVerdict.BAD),
        ("1 cw", "ccw", CheckVerdict.BAD),
        ("3", "ccw", CheckVerdict.BAD),
        ("2 cw", None, CheckVerdict.BAD),
        ("left", "ccw", CheckVerdict.BAD),
        ("", "ccw", CheckVerdict.BAD),
    ],
)
def test_gyro_and_operator_must_agree(said: str, told: str | None, verdict: CheckVerdict) -> None:
    step = {"ccw": -5.0, "cw": 5.0, None: 0.1}[told]
    assert judge(1, said, Reaction(step, 0.1)).verdict is verdict
