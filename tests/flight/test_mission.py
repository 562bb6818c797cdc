"""Planning an attempt: the approach fits the room, or the message says what to change."""

from dataclasses import replace
from math import cos, radians, sin

import pytest

from onboard.errors import InputError
from onboard.room import RoomGeometry
from perchhw.flight.mission import LOWEST_HOVER, START_MARGIN, ApproachNotPossible, plan_attempt
from tests.flight.unflown import REQUEST


@pytest.mark.parametrize(
    ("speed", "angle_deg"), [(1.5, 30.0), (2.25, 40.0), (2.5, 60.0), (2.5, 70.0), (2.75, 50.0), (3.0, 45.0)]
)
def test_the_authors_conditions_fit_the_default_room(speed: float, angle_deg: float) -> None:
    plan = plan_attempt(replace(REQUEST, speed=speed, angle_deg=angle_deg), policy_crc=1)
    assert RoomGeometry().contains(*plan.mission.start, margin=START_MARGIN)
    assert plan.mission.hover_height >= max(LOWEST_HOVER, plan.mission.start[2])
    assert plan.approach.vx == pytest.approx(speed * cos(radians(angle_deg)))
    assert plan.approach.vz == pytest.approx(speed * sin(radians(angle_deg)))
    assert plan.mission.approach_duration > plan.approach.tau0


def test_an_approach_that_cannot_start_above_the_floor_is_refused() -> None:
    with pytest.raises(InputError, match="does not fit the room"):
        plan_attempt(replace(REQUEST, speed=6.0, angle_deg=90.0), policy_crc=1)


def test_a_given_approach_that_starts_outside_the_room_is_refused() -> None:
    authors = {"ax": 1.0, "az": 3.1, "tau0": 0.5}
    short = replace(REQUEST, room=RoomGeometry(x_min=-2.5), approach=authors)
    with pytest.raises(ApproachNotPossible, match=r"larger approach\.ax"):
        plan_attempt(short, policy_crc=1)
    quick = replace(short, approach={**authors, "ax": 8.0})
    assert plan_attempt(quick, policy_crc=1).approach.ax == 8.0


@pytest.mark.parametrize("approach", [{"tau1": 0.5}, {"ax": 1.0}, {"ax": 1.0, "tau0": 0.5}])
def test_unknown_and_incomplete_approach_parameters_are_named(approach: dict[str, float]) -> None:
    with pytest.raises(ApproachNotPossible, match=r"tau1|az"):
        plan_attempt(replace(REQUEST, approach=approach), policy_crc=1)


def test_the_impact_point_moves_the_start_with_it() -> None:
    here = plan_attempt(REQUEST, policy_crc=1).mission.start
    there = plan_attempt(
        replace(REQUEST, approach={"impact_x": 0.3, "impact_y": -0.2}), policy_crc=1
    ).mission.start
    assert there[0] - here[0] == pytest.approx(0.3)
    assert there[1] == pytest.approx(-0.2)


@pytest.mark.parametrize(
    ("room", "said"),
    [
        (RoomGeometry(x_min=-1e9), "room: x_min is -1e\\+09 m; it must be -50 to 50 m"),
        (RoomGeometry(ceiling_z=float("nan")), "room: ceiling_z is nan m; give a number from 1 to 4 m"),
        (RoomGeometry(ceiling_z=100.0), "room: ceiling_z is 100 m"),
        (RoomGeometry(floor_z=-0.2), "room: floor_z is -0.2 m"),
    ],
)
def test_a_room_that_nothing_flies_in_is_refused(room: RoomGeometry, said: str) -> None:
    with pytest.raises(ApproachNotPossible, match=said):
        plan_attempt(replace(REQUEST, room=room), policy_crc=1)
