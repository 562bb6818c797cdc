"""Which effects are offered to a search, beside those that a model has already."""

from dataclasses import replace
from functools import cache

from calibration.gap.data.record import FlightRecord
from calibration.gap.estimate.model import Model, Variable
from calibration.gap.search.candidates import candidates
from onboard.vehicle import EFFECTS, load_vehicle
from tests.gap.simulated_flight import circle, fly

STOCK = load_vehicle("crazyflie21-stock")


@cache
def records() -> list[FlightRecord]:
    return [fly(STOCK, circle(), 4.0)]


AIR = Model(STOCK).with_values({Variable("rotor_drag", "coefficient"): 1e-6})


def offered(model: Model) -> dict[str, set[str]]:
    return {c.effect: {v.parameter for v in c.variables} for c in candidates(model, records())}


def test_a_mass_beside_a_scale_of_thrust_would_be_a_claim_about_inertia() -> None:
    assert {"thrust_scale", "mass_error"} <= offered(AIR).keys()
    for one, other in (("thrust_scale", "mass_error"), ("mass_error", "thrust_scale")):
        parameter = next(iter(EFFECTS[one].parameters))
        assert not {one, other} & offered(AIR.with_values({Variable(one, parameter): 0.9})).keys()


def test_wind_is_looked_for_along_the_floor_and_with_a_drag_where_there_is_none() -> None:
    assert offered(AIR)["wind"] == {"x", "y"}
    (wind,) = (c for c in candidates(Model(STOCK), records()) if c.effect == "wind")
    of_wind = [v.parameter for v in wind.variables if v.effect == "wind"]
    assert of_wind == ["x", "y"]
    assert {v.effect for v in wind.variables} == {"linear_drag", "wind"}


def test_where_no_voltage_was_logged_nothing_is_offered_that_an_emptying_pack_does_too() -> None:
    made = [replace(record, voltage_measured=False) for record in records()]
    names = {c.effect for c in candidates(AIR, made)}
    unseen = {"thrust_scale", "mass_error", "battery_sag", "motor_warming"}
    assert names.isdisjoint(unseen)
    assert unseen <= offered(AIR).keys()
