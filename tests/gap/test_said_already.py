"""What a vehicle file says already is nothing to find."""

import dataclasses

from calibration.gap.data.found_effect import FoundEffect, FoundParameter
from calibration.gap.estimate.acceptance import sizeable
from calibration.gap.estimate.model import Model, Variable
from calibration.gap.sensors import unsaid
from onboard.quantity import Quantity
from onboard.vehicle import Effect, Vehicle, load_vehicle

STOCK = load_vehicle("crazyflie21-stock")
MASS = Variable("mass_error", "relative")


def saying(name: str, **values: float) -> Vehicle:
    parameters = {
        key: Quantity(x, "m" if name == "pose_offset" else "1", 0.0, "file") for key, x in values.items()
    }
    return dataclasses.replace(STOCK, effects=(Effect(name=name, parameters=parameters),))


def offset(x: float) -> FoundEffect:
    parameters = {
        key: FoundParameter(value=v, unit="m", ci95=(v - 1e-3, v + 1e-3))
        for key, v in (("x", x), ("y", 0.0), ("z", 0.02))
    }
    return FoundEffect(
        name="pose_offset",
        parameters=parameters,
        error_before=1.0,
        error_after=0.5,
        improvement_ci95=(0.4, 0.6),
    )


def test_an_offset_is_found_where_the_file_says_none_or_another() -> None:
    assert unsaid((offset(0.01),), STOCK)
    assert unsaid((offset(0.03),), saying("pose_offset", x=0.01, y=0.0, z=0.02))
    assert not unsaid((offset(0.01),), saying("pose_offset", x=0.0105, y=0.0, z=0.02))


def test_a_mass_is_worth_a_name_by_how_far_it_is_from_that_of_the_file() -> None:
    heavy = saying("mass_error", relative=0.3)
    assert Model(STOCK).with_values({MASS: 0.3}).change(MASS) == 0.3
    assert sizeable(Model(STOCK).with_values({MASS: 0.3}), MASS)
    assert not sizeable(Model(heavy).with_values({MASS: 0.3005}), MASS)
    assert sizeable(Model(heavy).with_values({MASS: 0.2}), MASS)
    assert Model(heavy).start_value(MASS) == 0.3
