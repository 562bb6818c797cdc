"""What an effect does for flights that no fit saw has an interval, also on a single flight."""

import math
import re

import numpy as np
import pytest

from calibration.gap.data.found_effect import Improvement
from calibration.gap.data.signals import PARTS
from calibration.gap.estimate.held_out import HeldOutFlights, improvement
from calibration.gap.estimate.model import Model, Variable
from calibration.gap.replay.closed_loop import LOGGED, SETPOINT, UNTRIMMED, fly_setpoints
from calibration.gap.report.improved_vehicle import hard_to_fly
from onboard.controller import controller_gains
from onboard.room import RoomGeometry
from onboard.vehicle import Vehicle, load_vehicle
from sim_backend.physics.parameters import physics_parameters
from sim_backend.physics.reset import approaching, with_cold_motors
from tests.gap.simulated_flight import circle, fly, with_noise

STOCK = load_vehicle("crazyflie21-stock")
TRUE = Model(STOCK, {Variable("rotor_drag", "coefficient"): 2e-6})


def flights(count: int) -> HeldOutFlights:
    rng = np.random.default_rng(3)
    return HeldOutFlights(
        [
            with_noise(
                fly(TRUE.vehicle(), circle(), 8.0, shape="circle", name=f"{n}", believed=STOCK), 0.5, rng
            )
            for n in range(count)
        ]
    )


def test_a_single_flight_gives_an_interval() -> None:
    one = flights(1)
    gain = improvement(one.errors(Model(STOCK)), one.errors(TRUE), np.random.default_rng(1))
    low, high = gain.improvement_ci95
    assert 0.0 < low < gain.error_before - gain.error_after < high


def test_flights_are_drawn_whole_where_there_are_several() -> None:
    assert flights(1).errors(TRUE).counts.shape[0] == PARTS
    assert flights(2).errors(TRUE).counts.shape[0] == 2


def test_an_improvement_is_of_all_flights_and_its_interval_of_the_drawn_sets() -> None:
    squares = np.array([[4.0, 1.0], [9.0, 1.0], [17.0, 1.0]])
    drawn = np.array([[0, 0, 0], [1, 1, 1]])
    gain = Improvement.over(drawn, lambda flights: np.sqrt(squares[flights].mean(axis=-2)), "a metric")
    assert (gain.error_before, gain.error_after) == pytest.approx((math.sqrt(10.0), 1.0))
    assert gain.improvement_ci95 == pytest.approx((1.025, 1.975))
    assert gain.metric == "a metric"


def test_it_is_said_when_our_law_may_lose_the_vehicle_that_was_found() -> None:
    late = Model(STOCK, {Variable("command_delay", "delay"): 0.03}).vehicle()
    assert list(hard_to_fly(STOCK)) == []
    (sentence,) = hard_to_fly(late)
    assert "may lose it in closed loop" in sentence


UNEQUAL = Model(
    STOCK, {Variable("motor_imbalance", f"m{k}"): x for k, x in enumerate((1.06, 1.03, 1.04, 0.86), 1)}
)


def hovered(vehicle: Vehicle, seconds: float = 20.0) -> float:
    """How far (m) our law holds a vehicle from its place in hover, in the end."""
    p = physics_parameters(vehicle, RoomGeometry(ceiling_z=math.inf))
    rows = round(seconds / 0.01)
    setpoints, out = np.zeros((rows, SETPOINT)), np.empty((rows, LOGGED))
    setpoints[:, 2] = 1.0
    state = with_cold_motors(approaching(p, setpoints[0, :3], np.zeros(3)))
    fly_setpoints(
        state, p, controller_gains(vehicle), vehicle.motors.thrust_map_compiled(), setpoints,
        np.full(rows, 4.1), np.zeros((rows, 6)), UNTRIMMED, 10, 1e-3, 2, 10, out,
    )  # fmt: skip
    return float(np.hypot(*out[-1, :2]))


def test_it_is_said_where_our_law_would_hover() -> None:
    """It integrates no error of the attitude."""
    (sentence,) = hard_to_fly(UNEQUAL.vehicle())
    said = re.search(r"hover (\d\.\d\d) m beside its place", sentence)
    assert said is not None
    assert float(said[1]) == pytest.approx(hovered(UNEQUAL.vehicle()), abs=0.03)
    assert hovered(STOCK) < 0.01


def test_it_is_said_that_our_law_has_no_more_thrust_than_the_vehicle_file_gives_a_motor() -> None:
    (weak,) = hard_to_fly(Model(STOCK, {Variable("thrust_scale", "scale"): 0.6}).vehicle())
    assert "of the largest thrust that its file gives a motor" in weak
    (nothing,) = hard_to_fly(Model(STOCK, {Variable("thrust_scale", "scale"): 0.2}).vehicle())
    assert "does not hover at full duty" in nothing


def test_a_string_in_the_room_is_no_part_of_a_hover() -> None:
    string = {"x": 0.0, "y": 0.0, "z": 2.5, "length": 1.0, "stiffness": 0.3, "damping": 0.0}
    tied = Model(STOCK, {Variable("tether", key): x for key, x in string.items()})
    assert list(hard_to_fly(tied.vehicle())) == []
