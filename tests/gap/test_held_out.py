"""What an effect does for flights that no fit saw has an interval, also on a single flight."""

import math

import numpy as np

from calibration.gap.data.signals import PARTS
from calibration.gap.estimate.held_out import HeldOutFlights, improvement
from calibration.gap.estimate.model import Model, Variable
from calibration.gap.report.improved_vehicle import hard_to_fly
from onboard.controller import controller_gains
from onboard.vehicle import load_vehicle
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
    low, high = gain.interval
    assert 0.0 < low < gain.before - gain.after < high


def test_flights_are_drawn_whole_where_there_are_several() -> None:
    assert flights(1).errors(TRUE).counts.shape[0] == PARTS
    assert flights(2).errors(TRUE).counts.shape[0] == 2


def test_it_is_said_when_our_law_may_lose_the_vehicle_that_was_found() -> None:
    late = Model(STOCK, {Variable("command_delay", "delay"): 0.03}).vehicle()
    assert list(hard_to_fly(STOCK)) == []
    (sentence,) = hard_to_fly(late)
    assert "may lose it in closed loop" in sentence


def test_it_is_said_what_our_law_lacks_to_hold_the_vehicle_in_hover() -> None:
    """It integrates no error of the attitude, and stays within what the vehicle file gives a motor."""
    motors = {Variable("motor_imbalance", f"m{k}"): x for k, x in enumerate((1.06, 1.03, 1.04, 0.86), 1)}
    (leans,) = hard_to_fly(Model(STOCK, motors).vehicle())
    # Told 1 / m of a quarter of the weight each, they differ by 0.211 (roll) and -0.173 (pitch) of it.
    torque = 0.25 * STOCK.body.mass.value * 9.81 * STOCK.body.arm_x.value * math.hypot(0.211, 0.173)
    assert f"lean by {math.degrees(torque / controller_gains(STOCK).kr_xy):.0f} deg" in leans
    (weak,) = hard_to_fly(Model(STOCK, {Variable("thrust_scale", "scale"): 0.6}).vehicle())
    assert "of the largest thrust that its file gives a motor" in weak
