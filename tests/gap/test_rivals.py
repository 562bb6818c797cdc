"""What a rival's lead means: it may take a name's place, leave it in doubt, or make it too large a word."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from calibration.gap.estimate.acceptance import Judgement
from calibration.gap.estimate.model import Model, Variable
from calibration.gap.estimate.refine import refine, training_set
from calibration.gap.search.forward import outdone
from calibration.gap.search.rivals import Rival, doubt_of
from calibration.gap.search.selection import SelectionStep
from onboard.vehicle import load_vehicle
from tests.gap.simulated_flight import circle, fly, up_and_down, with_noise

STOCK = load_vehicle("crazyflie21-stock")


@pytest.fixture(scope="module")
def rival() -> Rival:
    """Three small numbers that explain as much as one name."""
    flight = fly(STOCK, circle(), 3.0, shape="circle", name="flight", believed=STOCK)
    record = with_noise(flight, 0.1, np.random.default_rng(1))
    model = Model(STOCK)
    return Rival(
        effect="inertia_error", named="thrust_scale", lead=-0.6, otherwise=1.4, gain=30.0, doubt=2.0,
        richer=True, sizeable=False, swallowed=(), freed=(), spared=(), fewer=False, one_for_four=False,
        fitted=refine(model, (), training_set([record], model), iterations=1),
    )  # fmt: skip


def test_what_is_too_small_for_a_name_and_explains_as_much_makes_a_name_too_much(rival: Rival) -> None:
    assert rival.negligible
    assert not rival.outdoes


@pytest.mark.parametrize(
    "different",
    [
        {"sizeable": True},
        {"lead": 5.0},
        {"otherwise": 5.0},
        {"swallowed": ("thrust_scale",)},
    ],
)
def test_what_is_large_or_explains_less_or_hides_a_cause_does_not(
    rival: Rival, different: dict[str, Any]
) -> None:
    assert not replace(rival, **different).negligible


@pytest.mark.parametrize(
    ("different", "simpler"),
    [
        ({}, True),
        ({"lead": 12.0}, False),
        ({"fewer": False}, False),
        ({"spared": ()}, False),
        ({"swallowed": ("thrust_scale",)}, False),
    ],
)
def test_one_name_for_two_is_simpler_where_the_flights_do_not_mind(
    rival: Rival, different: dict[str, Any], simpler: bool
) -> None:
    one = replace(rival, sizeable=True, spared=("velocity_moment",), fewer=True)
    assert replace(one, **different).says_the_same_with_fewer_names is simpler


@pytest.mark.parametrize(
    ("lead", "doubt", "told"),
    [(30.0, 20.0, True), (15.0, 20.0, False), (8.0, 2.0, False), (120.0, 500.0, True)],
)
def test_a_rival_is_ruled_out_by_a_lead_beyond_chance(
    rival: Rival, lead: float, doubt: float, told: bool
) -> None:
    one = replace(rival, richer=False, sizeable=True, lead=lead, doubt=doubt)
    assert one.told_apart is told


def test_of_few_flights_the_scatter_of_leads_is_itself_in_doubt() -> None:
    """The interval of Student's distribution: for three flights 4.3 standard errors, for thirty 2.0."""
    few, many = np.array([10.0, 20.0, 30.0]), np.tile([10.0, 20.0, 30.0], 10)
    assert doubt_of(few) == pytest.approx(4.303 * 10.0 * np.sqrt(3.0), rel=1e-3)
    assert doubt_of(many) == pytest.approx(2.045 * many.std(ddof=1) * np.sqrt(30.0), rel=1e-3)
    assert doubt_of(few[:1]) == float("inf")


@pytest.mark.parametrize(("lead", "takes_their_place"), [(-12.0, True), (8.0, True), (11.0, False)])
def test_a_scale_takes_the_place_of_four_motors_that_say_the_same(
    rival: Rival, lead: float, takes_their_place: bool
) -> None:
    scale = replace(rival, effect="thrust_scale", named="motor_imbalance", one_for_four=True, lead=lead)
    assert scale.says_the_same_with_fewer_names == takes_their_place
    assert not replace(scale, one_for_four=False).says_the_same_with_fewer_names


def test_a_scale_is_outdone_by_what_explains_more_to_the_end_whatever_a_first_look_said() -> None:
    heavy = Model(STOCK, {Variable("mass_error", "relative"): 0.1}).vehicle()
    rng = np.random.default_rng(1)
    paths = (circle(), circle(period=3.0), up_and_down(), up_and_down(period=2.0))
    records = [
        with_noise(fly(heavy, path, 6.0, name=f"flight {n}", believed=STOCK), 0.1, rng)
        for n, path in enumerate(paths)
    ]
    model = Model(STOCK)
    training = training_set(records, model)
    right, wrong = (
        SelectionStep(effect, Judgement(gain, True, True, (), {}), refine(model, variables, training))
        for effect, gain, variables in (
            ("mass_error", 20.0, [Variable("mass_error", "relative")]),
            ("linear_drag", 1e6, [Variable("linear_drag", axis) for axis in "xyz"]),
        )
    )
    assert not outdone(right, wrong, None)
    assert outdone(wrong, right, None)
    assert not outdone(wrong, right, right)
    assert not outdone(wrong, None, None)
