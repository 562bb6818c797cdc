"""What a controller commands to hold a model: trims, and what it does where the battery gives no more."""

import math
from typing import Any

import numpy as np
import pytest

from calibration.gap.data.record import FlightRecord
from calibration.gap.replay import fly_again
from calibration.gap.replay.flight_prediction import rotation_between
from calibration.gap.replay.hover import hover_command, mixed
from calibration.gap.replay.nuisances import Nuisances
from onboard.arrays import FloatArray
from onboard.battery import thrust_from_voltage
from onboard.mixer import mix
from onboard.room import RoomGeometry
from onboard.vehicle import load_vehicle
from sim_backend.physics.parameters import physics_parameters
from sim_backend.physics.state import new_state
from tests.gap.simulated_flight import circle, fly
from tests.physics.effects.conftest import with_effects

VEHICLE = load_vehicle("crazyflie21-upgraded-stored")
MAP = VEHICLE.motors.thrust_map_compiled()
VOLTS = 3.6
FULL = thrust_from_voltage(MAP, VOLTS)


def parameters(effects: dict[str, dict[str, float]] | None = None) -> Any:
    return physics_parameters(with_effects(effects) if effects else VEHICLE, RoomGeometry(ceiling_z=math.inf))


def duties(collective: float, moments: tuple[float, float, float]) -> FloatArray:
    state, duty = new_state(), np.zeros(4)
    state["battery_voltage"] = VOLTS
    mixed(state, parameters(), MAP, collective, moments, duty)
    return duty


def moments_of(duty: FloatArray) -> FloatArray:
    p = parameters()
    m1, m2, m3, m4 = (thrust_from_voltage(MAP, VOLTS * one) for one in duty)
    return np.array(
        [
            p["arm_y"] * (m3 + m4 - m1 - m2),
            p["arm_x"] * (m2 + m3 - m1 - m4),
            p["thrust_to_torque"] * (m2 + m4 - m1 - m3),
        ]
    )


ASKED = (8e-4, -5e-4, 1e-4)


def test_the_mixer_gives_what_is_asked_where_it_can() -> None:
    duty, p = duties(2.0 * FULL, ASKED), parameters()
    told = mix(2.0 * FULL, *ASKED, p["arm_x"], p["arm_y"], p["thrust_to_torque"], FULL)
    assert [thrust_from_voltage(MAP, VOLTS * one) for one in duty] == pytest.approx(told, rel=1e-9)
    assert np.sum([thrust_from_voltage(MAP, VOLTS * one) for one in duty]) == pytest.approx(2.0 * FULL)
    assert moments_of(duty) == pytest.approx(np.array(ASKED))


def test_where_the_battery_gives_no_more_the_collective_goes_and_the_moments_stay() -> None:
    duty = duties(5.0 * FULL, ASKED)
    assert duty.max() == pytest.approx(1.0)
    assert np.count_nonzero(duty > 0.99) == 1  # as in measured flights
    # By equal steps of duty, as the firmware takes them, in a map that is steeper at full duty.
    assert moments_of(duty) == pytest.approx(np.array(ASKED), rel=0.25)


def test_a_battery_that_is_not_there_is_no_crash() -> None:
    state, duty = new_state(), np.zeros(4)
    state["battery_voltage"] = 0.0
    mixed(state, parameters(), MAP, 0.3, ASKED, duty)
    assert np.all((duty >= 0.0) & (duty <= 1.0))


@pytest.mark.parametrize("scale", [0.7, 1.0, 1.2])
def test_a_weak_vehicle_needs_more_of_what_its_controller_believes(scale: float) -> None:
    pushed = (4e-4, -3e-4, 1e-4)
    p = parameters({"thrust_scale": {"scale": scale}})
    held = hover_command(p, MAP, 4.1, np.array([0.0, 0.0, 1.0]), pushed)
    assert held is not None
    assert held.collective == pytest.approx(p["mass"] * p["gravity"] / scale, rel=0.02)
    assert np.array(held.moments) == pytest.approx(-np.array(pushed) / scale, rel=0.03)


def test_a_strong_torque_of_its_own_does_not_tip_a_weak_vehicle() -> None:
    """As on real flights, which have up to 62 rad/s2 about roll."""
    weak = {"thrust_scale": {"scale": 0.85}}
    lap: FlightRecord = fly(with_effects(weak), circle(), believed=VEHICLE)
    again = fly_again(lap, with_effects(weak), Nuisances(angular_acceleration_rad_s2=(-60.0, 5.0, -14.0)))
    assert again is not None
    leans = np.degrees(np.linalg.norm(rotation_between(again.attitude, again.needed_attitude), axis=1))
    assert np.median(leans) < 3.0
    assert leans.max() < 20.0
