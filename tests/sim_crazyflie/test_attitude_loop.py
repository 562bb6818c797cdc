"""The attitude loop of the simulated drone: the calculated delay margin is where it really is lost."""

import dataclasses

import numpy as np
import pytest

from onboard.attitude_margins import attitude_margins
from onboard.controller import controller_gains
from onboard.quantity import Quantity
from onboard.vehicle import Effect, Vehicle, load_vehicle
from tests.sim_crazyflie.simulated_flight import LEGS, VEHICLE, Flight

SHAKES = 0.3
"""rad/s rms of body rate: far above the hover of a stable loop (0.05 close to its limit)."""


def slow_vehicle(lag_up: float, lag_down: float, delay: float) -> Vehicle:
    """The vehicle with motors of these lags, told what to do `delay` (s) too late."""
    vehicle = load_vehicle(VEHICLE, LEGS)
    up, down, late = (Quantity(value, "s", 0.0, "test case") for value in (lag_up, lag_down, delay))
    motors = dataclasses.replace(vehicle.motors, time_constant_up=up, time_constant_down=down)
    effect = Effect(name="command_delay", parameters={"delay": late})
    return dataclasses.replace(vehicle, motors=motors, effects=(effect,))


def hovers(vehicle: Vehicle) -> bool:
    """Whether it stays up and still in the fifth second after the take-off to 0.8 m."""
    flight = Flight(vehicle=vehicle, flashed=dataclasses.replace(vehicle, effects=()))
    flight.arm()
    assert flight.takeoff(0.8) == 0
    flight.run(5.0)
    rates = []
    for _ in range(1000):
        flight.tick()
        rates.append(flight.drone.state["omega"].copy())
    rms = float(np.sqrt(np.mean(np.sum(np.square(rates), axis=1))))
    return rms < SHAKES and abs(flight.position[2] - 0.8) < 0.1


@pytest.mark.slow
@pytest.mark.parametrize(
    ("lag_up", "lag_down"),
    [(0.05, 0.05), pytest.param(0.075, 0.141, marks=pytest.mark.soak), (0.15, 0.15)],
)
def test_the_loop_is_lost_at_its_delay_margin(lag_up: float, lag_down: float) -> None:
    gains = controller_gains(load_vehicle(VEHICLE, LEGS))
    margin = attitude_margins(gains, lag_up, lag_down).delay
    assert hovers(slow_vehicle(lag_up, lag_down, 0.85 * margin))
    assert not hovers(slow_vehicle(lag_up, lag_down, 1.25 * margin))
