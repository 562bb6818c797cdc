"""Second axes of the hinges and shapes of the hull as candidates for what landings lack."""

import dataclasses

import numpy as np
import pytest

from calibration.gap.data.found_effect import Verdict
from calibration.gap.landings.outcomes.search import GROUPS, OutcomeSearch, search_outcomes
from calibration.gap.landings.outcomes.vehicles import (
    WITHOUT,
    Point,
    bare_parameters,
    filed_point,
    grid,
    shapes,
    with_point,
)
from calibration.gap.landings.outcomes.verdict import improved_vehicle, in_words
from onboard.json_file import as_json
from onboard.quantity import Quantity
from onboard.room import RoomGeometry
from onboard.vehicle import EFFECTS, Effect, Vehicle, load_vehicle
from sim_backend.physics.parameters import physics_parameters
from tests.gap.test_pad_law_search import KIND, KNOWS, RATES_ALONE, REAL
from tests.tiers import some

PADS = WITHOUT._replace(speed=0.6, spread=0.4)
SHAPED = {
    "axes": {"side_stiffness": 4.0, "side_damping": 4.0},
    "hull": {"width": -0.02, "top": 0.01, "bottom": 0.006},
}


def searched(group: str, pads: np.ndarray, both: np.ndarray) -> OutcomeSearch:
    """What is said where the vehicles with pads, and with pads and a shape besides, predict this."""
    points = [WITHOUT, PADS, WITHOUT._replace(**SHAPED[group]), PADS._replace(**SHAPED[group])]
    table = np.stack([KIND, pads, KIND, both])
    return search_outcomes(points, table, REAL, 200, np.random.default_rng(0))


@pytest.mark.parametrize("group", some(SHAPED, 2))
def test_a_shape_is_named_where_flights_are_predicted_worse_without_it(group: str) -> None:
    found = searched(group, RATES_ALONE, KNOWS)
    assert set(found.named) == {"pads", group}
    assert found.best.groups[-1] == group
    effect = {"axes": "leg_sideways", "hull": "hull_shape"}[group]
    entry = next(one for one in as_json(found)["effects"] if one["name"] == effect)
    assert set(entry["parameters"]) == set(EFFECTS[effect].parameters)
    assert f"its {group}: {effect}." in " ".join(
        in_words(Verdict.EFFECTS_FOUND, found.fits[0].left_one_out, found)
    )


@pytest.mark.parametrize("group", some(SHAPED, 2))
def test_a_shape_that_changes_nothing_is_left_open(group: str) -> None:
    found = searched(group, RATES_ALONE, RATES_ALONE)
    assert found.named == ("pads",)
    assert group in found.left_open
    assert found.gains[group].brier == pytest.approx(0.0, abs=1e-9)


@pytest.mark.further
def test_laws_of_pads_are_compared_with_what_all_of_them_were_tried_with() -> None:
    """A shape beside the speed helps the speed, and not against the other laws."""
    alone, beside = searched("hull", RATES_ALONE, RATES_ALONE), searched("hull", RATES_ALONE, KNOWS)
    assert beside.laws["angle"].brier == pytest.approx(alone.laws["angle"].brier, abs=1e-12)


def shaped() -> Vehicle:
    """A vehicle whose file has both already."""
    effects = tuple(
        Effect(
            name=name,
            parameters={
                key: Quantity(rule.typical, rule.unit, 0.0, "test")
                for key, rule in EFFECTS[name].parameters.items()
            },
        )
        for name in ("leg_sideways", "hull_shape")
    )
    vehicle = load_vehicle("crazyflie21-upgraded")
    return dataclasses.replace(vehicle, effects=(*vehicle.effects, *effects))


def test_a_vehicle_that_has_shapes_is_taken_apart_and_put_together_again() -> None:
    vehicle = shaped()
    bare, filed = bare_parameters(vehicle), filed_point(vehicle)
    assert filed.side_stiffness == EFFECTS["leg_sideways"].parameters["stiffness"].typical
    assert bare["sideways_stiffness"] == 0.0
    assert bare["body_half_x"] == pytest.approx(0.0375)
    assert with_point(bare, filed) == physics_parameters(vehicle, RoomGeometry())
    points = grid(bare, filed)
    assert filed in points
    for name in GROUPS["axes"] + GROUPS["hull"]:
        assert {getattr(WITHOUT, name), getattr(filed, name)} <= {getattr(point, name) for point in points}


def test_what_is_found_is_written_into_the_vehicle_file_in_place_of_what_stood_there() -> None:
    better = improved_vehicle(shaped(), searched("axes", RATES_ALONE, KNOWS), "a test")
    effects = {effect.name: effect.values() for effect in better.effects}
    assert effects["leg_sideways"] == {"stiffness": pytest.approx(4.0), "damping": pytest.approx(4.0)}
    assert effects["hull_shape"] == {
        key: rule.typical for key, rule in EFFECTS["hull_shape"].parameters.items()
    }


def test_shapes_are_tried_with_all_pads_and_hinges_and_lie_within_their_bounds() -> None:
    p = bare_parameters(load_vehicle("crazyflie21-upgraded-stored"))
    points = set(grid(p))
    for shape in shapes(p):
        for stiffness, damping in ((1.0, 1.0), (1.6, 8.0)):
            legs = Point(stiffness=stiffness, damping=damping)._replace(**shape)
            assert {legs, legs._replace(speed=0.6, spread=0.4)} <= points
    rules = {**EFFECTS["leg_sideways"].parameters, **EFFECTS["hull_shape"].parameters}
    for shape in shapes(p):
        for name, value in shape.items():
            rule = rules[name.removeprefix("side_")]
            assert rule.low <= value <= rule.high


def test_hulls_grow_with_the_vehicle_and_axes_do_not() -> None:
    p = bare_parameters(load_vehicle("crazyflie21-upgraded"))
    large = p.copy()
    large["arm_x"] *= 2.0
    for one, other in zip(shapes(p), shapes(large), strict=True):
        for name, value in one.items():
            assert other[name] == pytest.approx(value if name.startswith("side_") else 2.0 * value)
