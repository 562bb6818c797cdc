"""The corridor of the approach: the least deviation within the window of times, and its three limits."""

from dataclasses import replace
from math import atan2, cos, degrees, radians, sin
from typing import Any

import pytest

from onboard.arrays import Vector
from onboard.gravity import GRAVITY
from onboard.jit import interpreted
from onboard.trajectory import sample_approach
from perchhw.supervisor import SafetyLimits
from perchhw.supervisor.corridor import Deviation, deviation, inside_corridor
from perchhw.supervisor.gate import GateMemory, admit
from perchhw.supervisor.observation import Admitted

from .simulated_attempt import PLAN, good_on_ground, turned

LIMITS = SafetyLimits()
UP = (0.0, 0.0, 1.0)
ALONG_X = degrees(atan2(PLAN.ax, GRAVITY))
"""Planned tilt while accelerating along x, deg."""
WHILE_X, WHILE_Z, ON_THE_LINE = 0.5 * PLAN.t_x, PLAN.t_x + 0.5 * PLAN.t_z, PLAN.impact_time - 0.2


def planned(seconds: float) -> tuple[Vector, Vector]:
    place, velocity, _ = interpreted(sample_approach)(PLAN, seconds)
    return place, velocity


def off_plan(seconds: float, later: float, window: float, axis: Vector = UP) -> Deviation:
    """A drone that is where it should be `later` s after `seconds`, judged at `seconds`."""
    return deviation(PLAN, seconds, window, *planned(seconds + later), axis)


@pytest.mark.parametrize("at", [WHILE_X, WHILE_Z, ON_THE_LINE])
def test_on_the_plan_nothing_deviates(at: float) -> None:
    assert off_plan(at, 0.0, 0.2)[:2] == pytest.approx((0.0, 0.0), abs=1e-9)


@pytest.mark.parametrize("at", [WHILE_Z, ON_THE_LINE])
@pytest.mark.parametrize("window", [0.08, 0.2])
def test_the_window_reaches_as_far_to_both_sides_and_no_farther(at: float, window: float) -> None:
    for edge in (-window, window):
        assert off_plan(at, edge, window).distance == pytest.approx(0.0, abs=1e-9)
        beyond = off_plan(at, 1.5 * edge, window).distance
        speed = planned(at + 1.25 * edge)[1]
        assert beyond == pytest.approx(0.5 * window * (speed[0] ** 2 + speed[2] ** 2) ** 0.5, rel=1e-3)


def test_the_window_is_searched_in_eighths() -> None:
    """Between two of the planned states the deviation is half of their distance."""
    for eighth in range(-4, 4):
        between = off_plan(ON_THE_LINE, 0.2 * (eighth + 0.5) / 4.0, 0.2)
        assert between.distance == pytest.approx(0.5 * 0.05 * 2.5, rel=1e-3)


@pytest.mark.parametrize(
    ("at", "axis", "tilt"),
    [
        (WHILE_X, UP, ALONG_X),
        (WHILE_X, (sin(radians(ALONG_X)), 0.0, cos(radians(ALONG_X))), 0.0),
        (WHILE_X, (-sin(radians(20.0)), 0.0, cos(radians(20.0))), 20.0 + ALONG_X),
        (WHILE_X, (0.0, sin(radians(ALONG_X)), cos(radians(ALONG_X))), 8.226),
        (WHILE_Z, (0.0, sin(radians(20.0)), cos(radians(20.0))), 20.0),
        (ON_THE_LINE, UP, 0.0),
        (ON_THE_LINE, (0.0, sin(radians(12.0)), cos(radians(12.0))), 12.0),
        (ON_THE_LINE, (sin(radians(170.0)), 0.0, cos(radians(170.0))), 170.0),
        (ON_THE_LINE, (0.0, 0.0, -1.0), 180.0),
        (ON_THE_LINE, (0.0, 0.0, 1.0 + 1e-12), 0.0),
        (ON_THE_LINE, (0.0, 0.0, -1.0 - 1e-12), 180.0),
    ],
)
def test_the_tilt_is_measured_from_the_thrust_that_the_plan_needs(
    at: float, axis: Vector, tilt: float
) -> None:
    assert off_plan(at, 0.0, 0.05, axis).tilt == pytest.approx(tilt, abs=2e-3)


def test_the_deviations_need_not_be_least_at_the_same_time() -> None:
    ahead, behind = planned(ON_THE_LINE + 0.2)[0], planned(PLAN.t_x + 0.1)[1]
    off = deviation(PLAN, PLAN.t_x + 0.2, 0.2, planned(PLAN.t_x + 0.4)[0], behind, UP)
    assert off == pytest.approx((0.0, 0.0, 0.0), abs=1e-9)
    assert deviation(PLAN, ON_THE_LINE, 0.2, ahead, behind, UP).speed > 0.5


def at(seconds: float, **changes: Any) -> Admitted:
    """A drone that follows the plan, but for `changes`."""
    place, velocity = planned(seconds)
    good = replace(good_on_ground(), estimate_position=place, estimate_velocity=velocity)
    return admit(replace(good, **changes), GateMemory(), LIMITS, 0.0)[0]


def beside(distance: float) -> Vector:
    x, y, z = planned(ON_THE_LINE)[0]
    return (x, y + distance, z)


def faster(speed: float) -> Vector:
    x, y, z = planned(ON_THE_LINE)[1]
    return (x, y + speed, z)


@pytest.mark.parametrize(
    ("rule", "inside", "outside"),
    [
        ("corridor_distance", {"estimate_position": beside(0.599)}, {"estimate_position": beside(0.601)}),
        ("corridor_speed", {"estimate_velocity": faster(1.199)}, {"estimate_velocity": faster(1.201)}),
        (
            "corridor_tilt",
            {"estimate_quaternion": turned(tilt=radians(34.9))},
            {"estimate_quaternion": turned(tilt=radians(35.1))},
        ),
    ],
)
def test_the_corridor_has_its_limits(rule: str, inside: dict[str, Any], outside: dict[str, Any]) -> None:
    assert inside_corridor(at(ON_THE_LINE, **inside), PLAN, ON_THE_LINE, LIMITS) is None
    violation = inside_corridor(at(ON_THE_LINE, **outside), PLAN, ON_THE_LINE, LIMITS)
    assert violation is not None
    assert violation.rule == rule


@pytest.mark.parametrize("name", ["estimate_position", "estimate_velocity", "estimate_quaternion"])
def test_who_does_not_know_where_it_is_is_not_in_the_corridor(name: str) -> None:
    violation = inside_corridor(at(ON_THE_LINE, **{name: None}), PLAN, ON_THE_LINE, LIMITS)
    assert str(violation) == "corridor: unknown, need known"


@pytest.mark.parametrize("shift", [-0.2, 0.2])
def test_the_corridor_allows_what_its_time_allows(shift: float) -> None:
    """Behind the impact the plan goes on at constant velocity: 0.24 s of it are 0.6 m."""
    now = PLAN.impact_time + 1.0
    place, velocity = planned(now + 2.2 * shift)
    late = at(now, estimate_position=place, estimate_velocity=velocity)
    assert inside_corridor(late, PLAN, now, replace(LIMITS, corridor_distance=0.601)) is None
    violation = inside_corridor(late, PLAN, now, replace(LIMITS, corridor_distance=0.599))
    assert violation is not None
    assert violation.rule == "corridor_distance"
