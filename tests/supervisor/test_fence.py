"""The fence: how far from walls, ceiling and floor a drone must be to stop in time, and how it says so."""

from collections.abc import Callable
from dataclasses import replace
from math import radians, tan
from typing import Any

import pytest

from onboard.room import RoomGeometry
from perchhw.supervisor.space import (
    clear_of_ceiling,
    clear_of_floor,
    clear_of_walls,
    inside_room,
)
from perchhw.supervisor.violation import Rule

from .test_limits import AIR, LIMITS, at, judged

FENCES: list[tuple[Rule, Callable[[float, float], dict[str, Any]]]] = [
    (clear_of_walls, lambda far, v: at(-6.5 + far, 0.0, 1.0, -v, 0.0, 0.0)),
    (clear_of_walls, lambda far, v: at(2.0 - far, 0.0, 1.0, v, 0.0, 0.0)),
    (clear_of_walls, lambda far, v: at(-2.0, -1.0 + far, 1.0, 0.0, -v, 0.0)),
    (clear_of_walls, lambda far, v: at(-2.0, 1.0 - far, 1.0, 0.0, v, 0.0)),
    (clear_of_ceiling, lambda far, v: at(-2.0, 0.0, 2.1 - far, 0.0, 0.0, v)),
    (clear_of_floor, lambda far, v: at(-2.0, 0.0, far, 0.0, 0.0, -v)),
]


@pytest.mark.parametrize(
    ("rule", "place"), FENCES, ids=["x_min", "x_max", "y_min", "y_max", "ceiling", "floor"]
)
def test_a_fence_is_as_far_away_as_the_drone_needs_to_stop(
    rule: Rule, place: Callable[[float, float], dict[str, Any]]
) -> None:
    def clear(far: float, speed: float, **age: float) -> bool:
        changes = {**place(far, speed), **age}
        return judged(rule, AIR, **changes) is None

    assert clear(0.01, 0.0)
    assert clear(0.01, -3.0)
    assert not clear(-0.01, 0.0)
    assert not clear(-0.01, -0.5)
    assert not clear(-0.01, -1.0)
    # At 2 m/s: 0.1 s of latency, and 4 / 16 m.
    assert clear(0.451, 2.0, estimate_age=0.0)
    assert not clear(0.449, 2.0, estimate_age=0.0)
    assert clear(0.851, 2.0, estimate_age=0.2)
    assert not clear(0.849, 2.0, estimate_age=0.2)


@pytest.mark.parametrize(
    ("rule", "told"),
    [
        (clear_of_walls, "fence_walls"),
        (clear_of_ceiling, "fence_ceiling"),
        (clear_of_floor, "fence_floor"),
    ],
)
@pytest.mark.parametrize("name", ["estimate_position", "estimate_velocity"])
def test_a_fence_denies_what_does_not_know_where_it_goes(rule: Rule, told: str, name: str) -> None:
    unknown: dict[str, Any] = {name: None}
    assert str(judged(rule, AIR, **unknown)) == f"{told}: unknown, need known"


@pytest.mark.parametrize("name", ["x", "y"])
@pytest.mark.parametrize("degrees_up", [10.0, -10.0])
def test_a_ceiling_that_falls_towards_the_drone_comes_nearer(name: str, degrees_up: float) -> None:
    slope = tan(radians(degrees_up))
    tilted = replace(LIMITS, room=RoomGeometry(**{f"ceiling_tilt_{name}": radians(degrees_up)}))
    x, y = -1.5, 0.4
    ceiling = 2.1 + slope * (x if name == "x" else y)

    def clear(below: float, speed: float, climb: float = 0.0) -> bool:
        velocity = (speed, 0.0, climb) if name == "x" else (0.0, speed, climb)
        return judged(clear_of_ceiling, AIR, tilted, **at(x, y, ceiling - below, *velocity)) is None

    sign = 1.0 if degrees_up > 0.0 else -1.0
    assert clear(0.02, 0.0)
    assert clear(0.02, sign)
    # 0.1763 m/s of closing: 0.0194 m and 0.0019 m.
    assert clear(0.0215, -sign)
    assert not clear(0.0211, -sign)
    assert not clear(0.0215, -sign, 0.02)


@pytest.mark.parametrize("rule", [clear_of_walls, inside_room])
def test_a_margin_of_the_walls_is_kept(rule: Rule) -> None:
    kept = replace(LIMITS, wall_margin=0.2)
    for inside, outside in (
        ((1.79, 0.0), (1.81, 0.0)),
        ((-6.29, 0.0), (-6.31, 0.0)),
        ((0.0, 0.79), (0.0, 0.81)),
    ):
        assert judged(rule, AIR, kept, **at(*inside, 1.0, 0.0, 0.0, 0.0)) is None
        assert judged(rule, AIR, kept, **at(*outside, 1.0, 0.0, 0.0, 0.0)) is not None


def test_a_place_outside_the_room_is_told() -> None:
    violation = judged(inside_room, AIR, pose_position=(2.5, 0.126, 1.0))
    assert str(violation) == f"inside_room: (2.50, 0.13, 1.00) m, need inside {LIMITS.room}"
    assert str(judged(inside_room, AIR, pose_position=None)) == "inside_room: unknown, need known"
