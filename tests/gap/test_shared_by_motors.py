"""Four motors do not stand for an error of scale and a centre of mass, which explain as much with less."""

from dataclasses import replace

import numpy as np
import pytest

from calibration.gap.estimate.acceptance import Judgement, judge
from calibration.gap.estimate.model import Model, Variable
from calibration.gap.estimate.refine import refine, settled, training_set
from calibration.gap.search.forward import search
from calibration.gap.search.naming import name_effects
from calibration.gap.search.selection import SearchContext, SelectionStep
from calibration.gap.search.shared_by_motors import scale_shared_by, shares_a_scale
from onboard.vehicle import load_vehicle
from tests.gap.mujoco_flights import flights, frame
from tests.gap.simulated_flight import circle, fly, with_noise
from tests.truth.airframe import nominal
from tests.truth.mujoco_room import Hidden

STOCK = load_vehicle("crazyflie21-stock")
MOTORS = tuple(Variable("motor_imbalance", f"m{number}") for number in (1, 2, 3, 4))
SCALED = Model(STOCK, {Variable("thrust_scale", "scale"): 1.07})
SHIFTED = Hidden(thrust_scale=1.06, centre=(0.01 * frame().arm, -0.05 * frame().arm, 0.0))
ONE_WEAK = Hidden(motors=(0.92, 1.0, 1.0, 1.0))


@pytest.mark.parametrize(
    ("motors", "shared"), [((0.9, 1.0, 1.0, 1.0), True), ((0.95, 1.05, 0.97, 1.035), False)]
)
def test_motors_that_are_off_together_share_a_scale(motors: tuple[float, ...], shared: bool) -> None:
    record = with_noise(fly(STOCK, circle(), 3.0), 0.1, np.random.default_rng(1))
    first = refine(Model(STOCK), (), training_set([record], Model(STOCK)), iterations=1)
    four = replace(first, model=Model(STOCK, dict(zip(MOTORS, motors, strict=True))))
    judged = Judgement(100.0, True, True, (), {})
    assert shares_a_scale(SelectionStep("motor_imbalance", judged, four)) is shared
    assert not shares_a_scale(SelectionStep("thrust_scale", judged, replace(first, model=SCALED)))


@pytest.mark.parametrize(("hidden", "scale"), [(SHIFTED, "thrust_scale"), (ONE_WEAK, None)])
def test_a_scale_beside_a_centre_of_mass_explains_what_four_motors_do(
    hidden: Hidden, scale: str | None
) -> None:
    model = Model(nominal(frame(), "shared"))
    training = training_set(flights(hidden), model)
    first = refine(model, (), training)
    four = settled(refine(model, MOTORS, training, start=first), training)
    came_in = SelectionStep(
        "motor_imbalance", judge(first, four, MOTORS, training, np.random.default_rng(1)), four
    )
    assert shares_a_scale(came_in)
    assert scale_shared_by(came_in, first, training) == scale


@pytest.mark.further
@pytest.mark.parametrize(
    ("hidden", "named"), [(SHIFTED, {"thrust_scale", "com_offset"}), (ONE_WEAK, {"motor_imbalance"})]
)
def test_a_scale_and_a_centre_of_mass_are_named_for_what_they_are(hidden: Hidden, named: set[str]) -> None:
    model = Model(nominal(frame(), "shared"))
    training = training_set(flights(hidden), model)
    found = search(model, SearchContext(training, np.random.default_rng(1)))
    assert set(name_effects(found, training).effects) == named
