"""A hull of another shape touches where its corners are, and nothing else of the vehicle changes."""

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from onboard.room import RoomGeometry
from onboard.vehicle import EFFECTS
from perchhw.label.geometry import landing_geometry
from sim_backend.physics.landing_factors import window_low
from sim_backend.physics.parameters import physics_parameters
from sim_backend.physics.reset import approaching
from sim_backend.physics.step import step_thrust
from tests.physics.effects.conftest import Effects, with_effects
from tests.tiers import some

ROOM = RoomGeometry()
OFF = (0.0, 0.0, 0.0, 0.0)
RULES = EFFECTS["hull_shape"].parameters
SHAPE = st.tuples(*(st.floats(rule.low, rule.high) for rule in RULES.values()))


def shaped(width: float = 0.0, top: float = 0.0, bottom: float = 0.0) -> Effects:
    return {"hull_shape": {"width": width, "top": top, "bottom": bottom}}


def parameters(effects: Effects, reach: float = 0.0) -> Any:
    """Without propellers that touch, so that the box is what does."""
    return physics_parameters(with_effects({**effects, "propeller_reach": {"scale": reach}}), ROOM)


def touches_at(p: Any, quaternion: list[float]) -> float:
    """Height (m) of the origin at which a vehicle in this attitude, moved up slowly, first touches."""
    low, high = ROOM.ceiling_z - 0.2, ROOM.ceiling_z
    for _ in range(40):
        middle = 0.5 * (low + high)
        state = approaching(p, np.array([0.0, 0.0, middle]), np.zeros(3))
        state["quaternion"], state["thrust"] = quaternion, 0.0
        step_thrust(state, p, OFF, 1e-9)
        low, high = (low, middle) if state["body_contact"] else (middle, high)
    return low


@pytest.mark.parametrize("pitch", some([0.8, 0.0, 0.5 * math.pi], 3))
@given(shape=SHAPE)
def test_the_corner_that_comes_first_is_where_the_shape_puts_it(
    pitch: float, shape: tuple[float, float, float]
) -> None:
    """Level, on the nose, and leaning: the ceiling is met where a corner of the box is."""
    width, top, bottom = shape
    p = parameters(shaped(width, top, bottom))
    q = [0.0, math.sin(0.5 * pitch), 0.0, math.cos(0.5 * pitch)]
    half = 0.0375 + width
    corners = [
        -math.sin(pitch) * x + math.cos(pitch) * z
        for x in (half, -half)
        for z in (0.015 + top, -0.0075 - bottom)
    ]
    hubs = [-math.sin(pitch) * x + math.cos(pitch) * 0.014 for x in (0.0325, -0.0325)]
    assert ROOM.ceiling_z - touches_at(p, q) == pytest.approx(max(*corners, *hubs), abs=1e-8)


def test_nothing_but_the_box_changes() -> None:
    plain, changed = parameters({}), parameters(shaped(-0.01, 0.01, 0.005))
    different = {name for name in plain.dtype.names if not np.array_equal(plain[name], changed[name])}
    assert different == {"body_half_x", "body_half_y", "body_top_z", "body_bottom_z"}
    assert parameters(shaped()) == plain


def test_the_order_of_the_effects_does_not_matter() -> None:
    """The centre of mass moves what the shape moves."""
    shift: Effects = {"com_offset": {"x": 0.001, "y": 0.0, "z": -0.002}}
    shape = shaped(-0.01, 0.01, 0.005)
    one, other = parameters({**shift, **shape}), parameters({**shape, **shift})
    for name in ("body_half_x", "body_top_z", "body_bottom_z"):
        assert one[name] == pytest.approx(float(other[name]), abs=1e-15)


def test_a_box_that_is_made_as_narrow_as_can_be_is_a_line_and_not_less() -> None:
    p = parameters(shaped(width=-0.05))
    assert p["body_half_x"] == p["body_half_y"] == 0.0


def test_a_wider_hull_leaves_feet_less_room() -> None:
    """Least tilt at which a fore foot comes first; it stands 43.5 mm out, beyond the box or within it."""
    narrow, wide = window_low(parameters(shaped())), window_low(parameters(shaped(width=0.0225)))
    assert narrow < math.radians(85.0) < math.radians(95.0) < wide


def test_the_reach_of_the_vehicle_follows() -> None:
    assert parameters(shaped(width=0.0225, top=0.03))["reach"] >= math.hypot(0.06, 0.06, 0.045)


def test_labels_and_physics_speak_of_the_same_hull() -> None:
    vehicle = with_effects(shaped(-0.02, 0.02, 0.01))
    points = landing_geometry(vehicle).body_points[:8]
    p = physics_parameters(vehicle, ROOM)
    assert points.max(axis=0) == pytest.approx([p["body_half_x"], p["body_half_y"], p["body_top_z"]])
    assert points.min(axis=0)[2] == pytest.approx(float(p["body_bottom_z"]))
