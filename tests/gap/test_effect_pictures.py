"""The picture of an effect shows it where it stands out, and the flights agree with what it says."""

from functools import cache

import numpy as np
import pytest

from calibration.gap.estimate.model import Model, Variable
from calibration.gap.estimate.refine import Fitted, Training, refine, training_set
from calibration.gap.report.effect_pictures import effect_pictures
from onboard.vehicle import load_vehicle
from tests.gap.simulated_flight import circle, fly, up_and_down, with_noise

STOCK = load_vehicle("crazyflie21-stock")
INFLOW, DELAY = Variable("inflow_thrust_loss", "coefficient"), Variable("command_delay", "delay")


@cache
def found() -> tuple[Fitted, Training]:
    rng = np.random.default_rng(5)
    truth = Model(STOCK, {INFLOW: 3e-6, DELAY: 0.012}).vehicle()
    paths = (circle(), up_and_down(), circle(period=3.0), up_and_down(period=2.0))
    records = [
        with_noise(fly(truth, path, 12.0, shape=f"shape {n}", name=f"{n}", believed=STOCK), 0.5, rng)
        for n, path in enumerate(paths)
    ]
    training = training_set(records, Model(STOCK))
    return refine(Model(STOCK), (INFLOW, DELAY), training), training


def test_a_loss_by_climbing_is_drawn_over_the_speed_along_the_thrust() -> None:
    (picture,) = effect_pictures(["inflow_thrust_loss"], *found())
    assert (picture.channel, picture.regressor) == ("force_z", "velocity_z")
    slope = np.polyfit(picture.x, picture.second, 1)[0]
    assert slope < 0.0
    assert np.polyfit(picture.x, picture.first, 1)[0] == pytest.approx(slope, rel=0.1)


def test_a_delay_is_drawn_over_the_rate_that_its_commands_answer() -> None:
    (picture,) = effect_pictures(["command_delay"], *found())
    assert (picture.channel, picture.regressor) == ("torque_x", "rate_x")
    assert np.polyfit(picture.x, picture.second, 1)[0] * np.polyfit(picture.x, picture.first, 1)[0] > 0.0


def test_what_goes_with_nothing_is_drawn_over_itself(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("calibration.gap.report.effect_pictures._TELLING", 0.9)  # more than anything tells
    (picture,) = effect_pictures(["command_delay"], *found())
    assert picture.regressor == "what the effect says"
    np.testing.assert_array_equal(picture.x, picture.second)
    assert np.polyfit(picture.second, picture.first, 1)[0] > 0.3  # answers to noise take from it


def test_an_effect_that_is_not_in_the_fit_has_no_picture() -> None:
    assert effect_pictures(["battery_sag"], *found()) == ()


def test_a_drag_is_drawn_where_it_is_judged() -> None:
    """A drag at the rotors makes a moment too, which is larger than its force in units of the noise."""
    rotors = Variable("rotor_drag", "coefficient")
    truth = Model(STOCK, {rotors: 3e-6}).vehicle()
    records = [with_noise(fly(truth, circle(), 12.0), 0.5, np.random.default_rng(n)) for n in range(2)]
    training = training_set(records, Model(STOCK))
    (picture,) = effect_pictures(["rotor_drag"], refine(Model(STOCK), (rotors,), training), training)
    assert picture.channel in ("force_x", "force_y")
