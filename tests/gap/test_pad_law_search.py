"""Which law of pads outcomes name, and what becomes of the vehicle file."""

import dataclasses
import math

import numpy as np
import pytest

from calibration.gap.data.found_effect import Verdict
from calibration.gap.landings.outcomes.pad_laws import pad_laws
from calibration.gap.landings.outcomes.search import LAWS, OutcomeSearch, estimate_of, search_outcomes
from calibration.gap.landings.outcomes.vehicles import (
    WITHOUT,
    bare_parameters,
    filed_point,
    grid,
    with_point,
)
from calibration.gap.landings.outcomes.verdict import improved_vehicle, in_words
from onboard.json_file import as_json
from onboard.quantity import Quantity
from onboard.room import RoomGeometry
from onboard.vehicle import Effect, Vehicle, load_vehicle
from sim_backend.physics.parameters import physics_parameters
from tests.tiers import some

FLIGHTS = 28
REAL = np.arange(FLIGHTS) % 2
"""Four legs and two in turn."""

KIND = np.tile([0.9, 0.05, 0.05], (FLIGHTS, 1))
"""As filed: nearly all hold on four."""
RATES_ALONE = np.tile([0.5, 0.45, 0.05], (FLIGHTS, 1))
"""How many hold, but not which."""
KNOWS = np.where(np.arange(3) == REAL[:, None], 0.9, 0.05)

SPEED = WITHOUT._replace(speed=0.6, spread=0.4)
PUSH = WITHOUT._replace(preload=2.0, preload_spread=0.5)


def searched(speed: np.ndarray, push: np.ndarray) -> OutcomeSearch:
    """What is said where the vehicles with a speed and with a push predict this."""
    table = np.stack([KIND, speed, push])
    return search_outcomes([WITHOUT, SPEED, PUSH], table, REAL, 200, np.random.default_rng(0))


@pytest.mark.parametrize(("knows", "other"), some([("pads", "preload"), ("preload", "pads")], 2))
def test_the_law_that_knows_which_flights_hold_is_named_and_the_other_one_refuted(
    knows: str, other: str
) -> None:
    found = searched(KNOWS, RATES_ALONE) if knows == "pads" else searched(RATES_ALONE, KNOWS)
    assert found.named == (knows,)
    assert knows in found.best.groups
    assert found.gains[other].brier < 0.0  # better than nothing
    assert found.laws[other].ci95[0] > 0.0
    assert other not in found.left_open


def test_laws_that_predict_alike_are_one_name_and_an_open_question() -> None:
    found = searched(RATES_ALONE, RATES_ALONE)
    assert len(found.named) == 1
    assert {"pads", "preload"} - set(found.named) <= set(found.left_open)
    document = as_json(found)
    assert document["effects"][0]["ambiguous_with"].count("foot_slip") == ("preload" not in found.named)
    assert set(document["search"]["laws"]) == set(LAWS)


def test_what_has_no_name_but_bends_a_value_widens_its_interval() -> None:
    """Flights that a high limit with hinges as filed predicts like a low one with softer hinges: the limit is
    either, also where one of the two models is a little better."""
    high = WITHOUT._replace(speed=1.4, spread=0.4)
    low = WITHOUT._replace(speed=0.6, spread=0.4, stiffness=0.5)
    nearly = 0.98 * KNOWS + 0.02 / 3.0
    points = [WITHOUT, WITHOUT._replace(stiffness=0.5), high, low]
    table = np.stack([KIND, KIND, KNOWS, nearly])
    found = search_outcomes(points, table, REAL, 200, np.random.default_rng(0))
    assert found.named == ("pads",)
    assert found.best.groups == ("pads",)
    assert found.best.values["speed"][0] > 1.3  # sure of it
    mean, sigma, (least, most), _ = found.values["speed"]
    assert least <= 0.6
    assert most >= 1.4
    assert 0.6 < mean < 1.4
    better = improved_vehicle(load_vehicle("crazyflie21-upgraded-stored"), found, "a test")
    written = next(e for e in better.effects if e.name == "pad_capture").parameters["speed"]
    assert written.value == pytest.approx(found.best.values["speed"][0])  # fits the hinges that are filed
    assert written.sigma is not None
    assert written.sigma >= sigma
    assert abs(written.value - 0.6) < 4.0 * written.sigma


@pytest.mark.parametrize(
    ("name", "levels", "shares", "ends"),
    [
        ("speed", (0.0, 1.5, 2.0), (0.5, 0.44, 0.06), (2.0,)),
        ("speed", (0.0, 1.5, 2.0), (0.5, 0.46, 0.04), ()),
        ("damping", (1.0, 8.0, 16.0), (0.1, 0.1, 0.8), (1.0, 16.0)),
        ("reach", (0.3, 0.64, 1.0), (0.1, 0.1, 0.8), (0.3,)),
        ("angle", (0.4, 1.0, np.pi), (0.1, 0.1, 0.8), (0.4,)),
        ("top", (0.0, 0.01), (0.1, 0.9), ()),
    ],
)
def test_a_posterior_that_runs_into_the_end_of_its_ladder_says_so(
    name: str, levels: tuple[float, ...], shares: tuple[float, ...], ends: tuple[float, ...]
) -> None:
    """Not where there is nothing beyond: no limit, the whole propeller; and a few hulls are no ladder."""
    found = estimate_of(name, np.array(levels), np.array(shares))
    assert (found.ends, found.at_bound) == (ends, bool(ends))


def test_a_lab_is_told_that_what_it_lacks_may_lie_beyond_what_was_tried() -> None:
    found = searched(KNOWS, RATES_ALONE)  # 0.6 m/s is the most that these vehicles have
    (said, *_) = in_words(Verdict.EFFECTS_FOUND, found.fits[0].left_one_out, found)
    assert "pad_capture.speed 0.6 " in said
    assert "m/s (filed 0; runs to 0.6, the end of what was tried: it may lie beyond)" in said
    assert as_json(found)["effects"][0]["parameters"]["speed"]["at_bound"] is True
    better = improved_vehicle(load_vehicle("crazyflie21-upgraded-stored"), found, "a test")
    written = next(e for e in better.effects if e.name == "pad_capture").parameters["speed"]
    assert written.source == "a test; at the end of what was tried, may lie beyond"


def test_pads_that_hold_only_what_comes_fast_are_among_the_vehicles() -> None:
    """And landings are simulated at limits beyond every mean, so that a spread has two sides."""
    vehicle = load_vehicle("crazyflie21-upgraded")
    bare = bare_parameters(vehicle)
    assert {point.speed for point in grid(bare, filed_point(vehicle))} >= {1.75, 2.0, 2.5}
    pads = pad_laws(bare)["pads"]
    assert max(pads.limits) > max(pads.means)


def test_no_law_is_named_where_none_helps() -> None:
    assert not set(LAWS) & set(searched(KIND, KIND).named)


def lossy() -> Vehicle:
    """A vehicle whose file has a speed, and feet that come off."""
    vehicle = load_vehicle("crazyflie21-upgraded")
    holds = {"adhesion_strength": Quantity(3.0, "N", 0.5, "test")}
    return dataclasses.replace(
        vehicle, effects=(*vehicle.effects, Effect(name="foot_slip", parameters=holds))
    )


def test_the_law_that_is_found_stands_in_place_of_the_filed_one_and_nothing_else_is_lost() -> None:
    vehicle = lossy()
    better = improved_vehicle(vehicle, searched(RATES_ALONE, KNOWS), "a test")
    effects = {effect.name: effect.values() for effect in better.effects}
    assert "pad_capture" not in effects
    assert effects["foot_slip"] == {
        "adhesion_strength": 3.0,
        "minimum_preload": pytest.approx(2.0, abs=0.2),
        "preload_spread": pytest.approx(0.5, abs=0.05),
    }
    before = {effect.name: effect.values() for effect in vehicle.effects}
    for name in ("leg_stiffness", "leg_damping", "pad_damping", "propeller_reach"):
        assert effects[name] == before[name]


def test_a_vehicle_is_taken_apart_and_put_together_again() -> None:
    vehicle = lossy()
    bare, filed = bare_parameters(vehicle), filed_point(vehicle)
    assert bare["adhesion_strength"] == 3.0  # not searched for: it stays
    assert bare["capture_speed"] == 0.0
    assert with_point(bare, filed) == physics_parameters(vehicle, RoomGeometry())
    assert filed in grid(bare, filed)


def test_limits_grow_with_the_vehicle() -> None:
    """Impulses as m v, pushes as v sqrt(k m); speeds and angles not at all."""
    p = bare_parameters(load_vehicle("crazyflie21-upgraded"))
    heavy = p.copy()
    heavy["mass"] *= 4.0
    light, laws = pad_laws(p), pad_laws(heavy)
    for name, ratio in (("pads", 1.0), ("angle", 1.0), ("impulse", 4.0), ("preload", 2.0)):
        np.testing.assert_allclose(laws[name].limits, ratio * np.array(light[name].limits))
        assert list(laws[name].limits) == sorted(laws[name].limits)
    weight = float(p["mass"] * p["gravity"])
    assert weight < light["preload"].limits[2] < light["preload"].limits[-1] < 20.0 * weight
    assert max(light["angle"].limits) == pytest.approx(0.5 * math.pi)
