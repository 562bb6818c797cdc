"""The room: where the ceiling is, and what is inside."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from onboard.errors import InputError
from onboard.room import RoomGeometry, ceiling_height
from onboard.trajectory import fit_approach

TILTED = RoomGeometry(floor_z=-0.1, ceiling_tilt_x=math.radians(2.0), ceiling_tilt_y=math.radians(-1.0))
places = st.tuples(st.floats(-6.5, 2.0), st.floats(-1.0, 1.0))


@given(places)
def test_a_level_ceiling_has_one_height_to_the_last_bit(place: tuple[float, float]) -> None:
    assert RoomGeometry().ceiling_at(*place) == RoomGeometry().ceiling_z


def test_a_tilted_ceiling_rises_along_its_axes() -> None:
    assert TILTED.ceiling_at(0.0, 0.0) == 2.1
    assert TILTED.ceiling_at(1.0, 0.0) == pytest.approx(2.1 + math.tan(math.radians(2.0)))
    assert TILTED.ceiling_at(0.0, 1.0) == pytest.approx(2.1 - math.tan(math.radians(1.0)))


@given(places)
def test_inside_is_between_floor_and_ceiling(place: tuple[float, float]) -> None:
    top = TILTED.ceiling_at(*place)
    assert top >= TILTED.lowest_ceiling
    assert TILTED.contains(*place, top)
    assert not TILTED.contains(*place, math.nextafter(top, math.inf))
    assert TILTED.contains(*place, -0.1)
    assert not TILTED.contains(*place, math.nextafter(-0.1, -math.inf))


def test_the_margin_is_kept_from_every_wall() -> None:
    room = RoomGeometry(x_min=-3.0, x_max=2.0, y_min=-1.5, y_max=1.0)
    for inside, outside in (
        ((-2.8, 0.0), (-2.81, 0.0)),
        ((1.8, 0.0), (1.81, 0.0)),
        ((0.0, -1.3), (0.0, -1.31)),
        ((0.0, 0.8), (0.0, 0.81)),
    ):
        assert room.contains(*inside, 1.0, margin=0.2)
        assert not room.contains(*outside, 1.0, margin=0.2)
    assert room.contains(0.0, 0.0, 2.1, margin=0.2)
    assert not room.contains(0.0, 0.0, 2.11, margin=0.2), "the ceiling is no wall"
    assert not room.contains(0.0, 0.0, -0.01, margin=0.2), "nor is the floor"


@pytest.mark.parametrize("axis", range(3))
@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
def test_a_place_that_is_no_number_is_not_inside(axis: int, value: float) -> None:
    place = [0.0, 0.0, 1.0]
    place[axis] = value
    assert not TILTED.contains(*place)


def test_an_approach_aims_at_the_ceiling_above_its_impact_point() -> None:
    plan = fit_approach(2.5, 55.0, TILTED, impact_x=0.5, impact_y=-0.3)
    assert plan.ceiling_z == TILTED.ceiling_at(0.5, -0.3)
    assert plan.z0 + plan.vz * plan.t_z / 2.0 + plan.vz * plan.tau0 == pytest.approx(plan.ceiling_z)


@pytest.mark.parametrize(
    ("given", "problem"),
    [
        (math.nan, "a ceiling at nan m cannot be"),
        (math.inf, "a ceiling at inf m cannot be"),
        (0, "a ceiling at 0 m cannot be"),
        (-1.0, "a ceiling at -1 m cannot be"),
        (2100, "a ceiling at 2100 m cannot be: give its height above the floor in m"),
        ("2.1", "ceiling_z: '2.1' is no number"),
        (True, "ceiling_z: True is no number"),
    ],
)
def test_what_is_no_height_of_a_ceiling_is_refused(given: object, problem: str) -> None:
    with pytest.raises(InputError, match=problem):
        ceiling_height(given)


@pytest.mark.parametrize("given", [2, 2.0, np.float32(2.0), np.int64(2)])
def test_the_height_of_a_ceiling_is_a_plain_number(given: object) -> None:
    assert repr(ceiling_height(given)) == "2.0"
