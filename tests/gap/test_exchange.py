"""The second look of a search: what may stand in the place of a name, and what may not."""

import dataclasses
from functools import cache

import numpy as np
import pytest

from calibration.gap.estimate.acceptance import judge, sizeable
from calibration.gap.estimate.model import Model, Variable
from calibration.gap.estimate.refine import Fitted, Training, refine, training_set
from calibration.gap.search.credible import credible
from calibration.gap.search.rivals import NOT_TOLD_APART, alike_in_all_motors, needed, rivals
from calibration.gap.search.second_look import second_look
from calibration.gap.search.selection import SearchContext, SelectionStep
from onboard.quantity import Quantity
from onboard.vehicle import Effect, Vehicle, load_vehicle
from tests.gap.simulated_flight import circle, fly, up_and_down, with_noise

STOCK = load_vehicle("crazyflie21-stock")
SCALE, MASS = Variable("thrust_scale", "scale"), Variable("mass_error", "relative")
MOTORS = tuple(Variable("motor_imbalance", f"m{k}") for k in range(1, 5))
INERTIAS = tuple(Variable("inertia_error", axis) for axis in ("xx", "yy", "zz"))


def weak() -> Vehicle:
    """10 % less thrust, and inertias that are 2 % off: torques that the vehicle file does not give quite."""
    effects = (("thrust_scale", {"scale": 0.9}), ("inertia_error", {"xx": 0.02, "yy": 0.02, "zz": 0.02}))
    return dataclasses.replace(
        STOCK,
        effects=tuple(
            Effect(name=name, parameters={k: Quantity(x, "1", 0.0, "hidden") for k, x in values.items()})
            for name, values in effects
        ),
    )


@cache
def training() -> Training:
    rng = np.random.default_rng(1)
    paths = (circle(), up_and_down(), circle(period=3.0), up_and_down(period=2.0), circle(radius=0.4))
    records = []
    for n, path in enumerate(paths):
        record = fly(weak(), path, 6.0, shape=f"shape {n}", name=f"flight {n}", believed=STOCK)
        noisy = with_noise(record, 0.1, rng)
        assert record.voltage is not None
        voltage = record.voltage + 0.005 * rng.standard_normal(record.t.size)
        records.append(dataclasses.replace(noisy, voltage=voltage))
    return training_set(records, Model(STOCK))


def fitted(*variables: Variable) -> Fitted:
    return refine(Model(STOCK), variables, training())


def looked_at(variables: tuple[Variable, ...]) -> tuple[Fitted, list[SelectionStep]]:
    """The second look at a search that named these."""
    rng, none, named = np.random.default_rng(1), fitted(), fitted(*variables)
    steps = [
        SelectionStep(
            effect, judge(none, named, [v for v in variables if v.effect == effect], training(), rng), named
        )
        for effect in named.model.effects
    ]
    present, left, _ = second_look(named, steps, SearchContext(training(), rng))
    return present, left


@pytest.mark.further
def test_an_inertia_that_leaves_the_weak_thrust_to_the_nuisances_is_no_rival_of_a_scale() -> None:
    scaled = fitted(SCALE)
    found = {rival.effect: rival for rival in rivals(scaled, "thrust_scale", [], training())}
    inertia = found["inertia_error"]
    assert inertia.lead < -50.0  # as torques, told more sharply than forces, speak for it
    assert inertia.swallowed == ("thrust_scale",)
    assert inertia.told_apart
    assert not inertia.outdoes
    assert "motor_imbalance" not in found


@pytest.mark.parametrize(
    ("motors", "alike"),
    [
        ((0.758, 0.795, 0.746, 0.668), True),  # 13 real flights, in the place of a scale of 0.72
        ((1.0, 1.0, 1.0, 0.8), False),
        ((1.06, 0.97, 1.05, 0.92), False),
    ],
)
def test_four_motors_that_are_all_weaker_are_a_scale(motors: tuple[float, ...], alike: bool) -> None:
    values = {Variable("motor_imbalance", f"m{k}"): value for k, value in enumerate(motors, 1)}
    assert alike_in_all_motors(Model(STOCK, values)) == alike
    assert not alike_in_all_motors(Model(STOCK, {SCALE: 0.8}))


def test_motors_that_a_centre_of_mass_undoes_are_alike_all_the_same() -> None:
    """Of 13 real flights: differences that roll, and a centre of mass 5 mm to the side of it."""
    motors = dict(zip(MOTORS, (0.593, 0.616, 1.018, 0.775), strict=True))
    assert not alike_in_all_motors(Model(STOCK, motors))
    assert alike_in_all_motors(Model(STOCK, {**motors, Variable("com_offset", "y"): 0.005}))


def test_a_scale_is_needed_where_four_motors_would_have_to_take_its_place() -> None:
    assert needed(fitted(SCALE, *MOTORS), "thrust_scale", training())
    assert not needed(fitted(SCALE, *MOTORS), "motor_imbalance", training())


def test_motors_that_are_alike_are_one_scale_by_the_rule_by_which_they_take_no_place_of_one() -> None:
    uneven = Model(STOCK, dict(zip(MOTORS, (0.86, 0.9, 0.88, 0.92), strict=True)))  # each worth a name
    assert alike_in_all_motors(uneven)
    final = dataclasses.replace(fitted(*MOTORS), model=uneven)
    found = {one.effect: one for one in rivals(final, "motor_imbalance", [], training())}
    assert found["thrust_scale"].one_for_four


def test_four_motors_that_are_all_as_weak_are_one_scale() -> None:
    (scale,) = (one for one in rivals(fitted(*MOTORS), "motor_imbalance", [], training()) if one.one_for_four)
    assert scale.effect == "thrust_scale"
    assert scale.says_the_same_with_fewer_names


def test_what_runs_into_its_bound_takes_no_name_s_place() -> None:
    """A thrust that is weak from the first second on is no loss by warmth."""
    warm = fitted(Variable("motor_warming", "loss"), Variable("motor_warming", "time_constant"))
    assert not credible(warm, "motor_warming", training())
    scaled = fitted(SCALE)
    assert credible(scaled, "thrust_scale", training())
    assert "motor_warming" not in {one.effect for one in rivals(scaled, "thrust_scale", [], training())}


def test_what_is_barred_is_not_even_fitted_as_a_rival() -> None:
    found = rivals(fitted(SCALE), "thrust_scale", [], training(), barred=("inertia_error",))
    assert "inertia_error" not in {one.effect for one in found}


@pytest.mark.further
def test_a_scale_takes_the_place_of_an_inertia_that_was_named_for_it() -> None:
    present, steps = looked_at(INERTIAS)
    assert [step.effect for step in steps] == ["thrust_scale"]
    assert present.model.values == {SCALE: pytest.approx(0.9, abs=0.02)}


@pytest.mark.further
def test_one_scale_takes_the_place_of_a_mass_and_an_inertia() -> None:
    """What is left of the inertia is what the vehicle file lacks: too small for a name."""
    present, _ = looked_at((MASS, *INERTIAS))
    assert present.model.values[SCALE] == pytest.approx(0.9, abs=0.002)
    assert [present.model.values[axis] for axis in INERTIAS] == pytest.approx([0.02] * 3, abs=0.005)
    assert not any(sizeable(present.model, axis) for axis in INERTIAS)
    assert set(present.model.values) == {SCALE, *INERTIAS}


@pytest.mark.further
def test_what_no_flight_tells_apart_is_said_with_the_fewer_names() -> None:
    (mass,) = [
        r for r in rivals(fitted(MASS, *INERTIAS), "mass_error", [], training()) if r.effect == SCALE.effect
    ]
    assert mass.says_the_same_with_fewer_names
    scaled = fitted(SCALE, *INERTIAS)
    (scale,) = [r for r in rivals(scaled, "thrust_scale", [], training()) if r.effect == MASS.effect]
    assert abs(scale.lead) < NOT_TOLD_APART
    assert not scale.says_the_same_with_fewer_names
