"""Which effects are offered to a search, beside those that a model has already."""

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


def test_wind_is_looked_for_where_there_is_air_to_move_and_only_along_the_floor() -> None:
    assert offered(AIR)["wind"] == {"x", "y"}
    assert "wind" not in offered(Model(STOCK))
