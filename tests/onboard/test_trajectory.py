"""Approach trajectory: the shape of errata 9, and what the room allows."""

import itertools
import math
import re
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from onboard.room import RoomGeometry
from onboard.trajectory import (
    ApproachError,
    ApproachPlan,
    approach_is_sound,
    fit_approach,
    plan_approach,
    sample_approach,
    smooth_approach,
    start_outside,
)
from tests.drawn_examples import examples

ROOM = RoomGeometry()


def plan(speed: float = 2.5, angle_deg: float = 40.0) -> ApproachPlan:
    return plan_approach(speed, angle_deg, 0.3, 2.1, 1.0, 3.1, 0.5, impact_y=-0.1)


conditions = st.tuples(st.floats(0.5, 2.2), st.floats(20.0, 90.0))


@given(conditions)
def test_reaches_the_velocity_tau0_before_the_ceiling_at_the_impact_point(
    condition: tuple[float, float],
) -> None:
    speed, angle_deg = condition
    approach = plan(speed, angle_deg)
    angle = math.radians(angle_deg)
    velocity = (speed * math.cos(angle), 0.0, speed * math.sin(angle))
    end = approach.t_x + approach.t_z
    for t in (end + 1e-9, end + 0.25, approach.impact_time):
        position, v, a = sample_approach(approach, t)
        assert v == pytest.approx(velocity, abs=1e-8)
        assert a == (0.0, 0.0, 0.0)
        assert (2.1 - position[2]) / v[2] == pytest.approx(approach.impact_time - t, abs=1e-9)
    assert sample_approach(approach, approach.impact_time)[0] == pytest.approx((0.3, -0.1, 2.1), abs=1e-9)


@given(conditions)
def test_velocity_is_the_derivative_and_never_overshoots(condition: tuple[float, float]) -> None:
    approach = plan(*condition)
    times = np.linspace(-0.1, approach.impact_time + 0.3, 400)
    samples = [sample_approach(approach, float(t)) for t in times]
    positions, velocities, accelerations = (np.array(part) for part in zip(*samples, strict=True))
    dt = times[1] - times[0]
    middle = 0.5 * (velocities[1:] + velocities[:-1])
    assert np.abs(np.diff(positions, axis=0) / dt - middle).max() < 3.1 * dt
    assert np.all(np.diff(velocities, axis=0) >= -1e-12)
    assert velocities[:, 0].max() <= approach.vx + 1e-12
    assert velocities[:, 2].max() <= approach.vz + 1e-12
    assert np.all(np.abs(np.diff(velocities, axis=0)) <= 3.1 * dt + 1e-12)
    # First x with z held, then z with v_x held: never both.
    assert not np.any((accelerations[:, 0] != 0.0) & (accelerations[:, 2] != 0.0))
    assert np.all(positions[times < approach.t_x, 2] == approach.z0)


def test_position_is_continuous_at_the_joints() -> None:
    approach = plan()
    for joint in (0.0, approach.t_x, approach.t_x + approach.t_z):
        before, after = (sample_approach(approach, joint + d) for d in (-1e-9, 1e-9))
        np.testing.assert_allclose(before[0], after[0], atol=1e-8)
        np.testing.assert_allclose(before[1], after[1], atol=1e-8)


def test_start_point_is_that_of_the_errata() -> None:
    approach = plan()
    vx, vz = approach.vx, approach.vz
    assert approach.z0 == pytest.approx(2.1 - 0.5 * vz - 3.1 * (vz / 3.1) ** 2 / 2)
    run_up = vx * (vx / 1.0 + vz / 3.1) - vx**2 / 2.0
    assert approach.x0 == pytest.approx(0.3 - run_up - 0.5 * vx)


def test_vertical_approach_has_no_run_up() -> None:
    approach = plan(1.5, 90.0)
    assert (approach.vx, approach.t_x, approach.x0) == (0.0, 0.0, 0.3)


@pytest.mark.parametrize(
    ("speed", "angle_deg"),
    [(v, a) for v, a in itertools.product(np.arange(1.5, 3.6, 0.25), np.arange(30, 91, 7.5))],
)
def test_grid_starts_inside_the_room_or_is_refused(speed: float, angle_deg: float) -> None:
    """The paper's grid; with at most 3.5 m/s2 and 0.3 s, climbs above 2.6 m/s need more height."""
    climb = speed * math.sin(math.radians(angle_deg))
    if 0.3 * climb + climb**2 / 7.0 > ROOM.ceiling_z - 0.4:
        with pytest.raises(
            ApproachError,
            match=r"What fits: [\d.]+ m/s at",
        ):
            fit_approach(float(speed), float(angle_deg), ROOM)
        return
    approach = fit_approach(float(speed), float(angle_deg), ROOM)
    assert ROOM.contains(approach.x0, approach.y0, approach.z0, 0.25)
    assert approach.z0 >= 0.4
    assert approach.tau0 >= 0.3
    assert approach.vz == pytest.approx(climb)


def test_slow_approaches_are_flown_as_the_authors_did() -> None:
    approach = fit_approach(2.0, 45.0, ROOM)
    assert (approach.ax, approach.az, approach.tau0) == (1.0, 3.1, 0.5)


@pytest.mark.parametrize(
    ("speed", "angle_deg", "ax", "tau0"),
    [
        (0.0, 40.0, 1.0, 0.5),
        (-1.0, 40.0, 1.0, 0.5),
        (2.0, 0.0, 1.0, 0.5),
        (2.0, 91.0, 1.0, 0.5),
        (math.nan, 40.0, 1.0, 0.5),
        (2.0, math.nan, 1.0, 0.5),
        (2.0, 40.0, 0.0, 0.5),
        (2.0, 40.0, math.nan, 0.5),
        (2.0, 40.0, 1.0, math.nan),
        (3.5, 90.0, 1.0, 0.5),
    ],
)
def test_impossible_approaches_are_refused(speed: float, angle_deg: float, ax: float, tau0: float) -> None:
    with pytest.raises(ApproachError):
        plan_approach(speed, angle_deg, 0.0, 2.1, ax, 3.1, tau0)


@pytest.mark.parametrize("field", ApproachPlan._fields)
@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
def test_a_plan_with_a_number_that_is_none_is_not_sound(field: str, value: float) -> None:
    good = plan()
    assert approach_is_sound(good, 0.2)
    if field not in ("impact_x", "t_x", "t_z"):
        assert not approach_is_sound(good._replace(**{field: value}), 0.2)


@pytest.mark.further
@settings(max_examples=examples(40))
@given(conditions, st.floats(0.02, 0.2), st.floats(0.0, 1.2))
def test_rounding_off_is_the_moving_average(
    condition: tuple[float, float], half_width: float, share: float
) -> None:
    approach = plan(*condition)
    t = share * approach.impact_time
    position, velocity, acceleration, jerk = smooth_approach(approach, t, half_width)
    around = np.linspace(t - half_width, t + half_width, 4001)
    samples = [sample_approach(approach, float(moment)) for moment in around]
    for got, exact in zip(
        (position, velocity), np.moveaxis(np.array([s[:2] for s in samples]), 1, 0), strict=True
    ):
        np.testing.assert_allclose(got, np.trapezoid(exact, around, axis=0) / (2 * half_width), atol=1e-5)
    step = 1e-5
    later = smooth_approach(approach, t + step, half_width)
    np.testing.assert_allclose((np.array(later[1]) - velocity) / step, acceleration, atol=1e-2)
    assert np.all(np.abs(np.array(jerk)) <= 3.1 / (2 * half_width) + 1e-9)


@given(conditions)
def test_rounding_off_changes_neither_the_hover_nor_the_line_of_constant_velocity(
    condition: tuple[float, float],
) -> None:
    approach = plan(*condition)
    for t in (-1.0, -0.08, approach.t_x + approach.t_z + 0.08, approach.impact_time):
        smooth, sharp = smooth_approach(approach, t, 0.08), sample_approach(approach, t)
        for got, wanted in zip(smooth[:3], sharp, strict=True):
            np.testing.assert_allclose(got, wanted, atol=1e-9)


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"x_min": -1.0}, "x = -1.61 m (from -0.75 to 1.75 m), {y}, {z}{margin}x is less than -0.75 m"),
        ({"x_max": -5.0}, "x = -1.61 m (from -6.25 to -5.25 m), {y}, {z}{margin}x is more than -5.25 m"),
        (
            {"y_min": -0.01, "y_max": 0.01},
            "{x}, y = 0.00 m (from 0.24 to -0.24 m), {z}{margin}nothing is left",
        ),
        ({"y_min": 0.0}, "{x}, y = 0.00 m (from 0.25 to 0.75 m), {z}{margin}y is less than 0.25 m"),
        ({"y_max": 0.2}, "{x}, y = 0.00 m (from -0.75 to -0.05 m), {z}{margin}y is more than -0.05 m"),
        ({"ceiling_z": 1.5}, "{x}, {y}, z = 0.29 m (from 0.40 to 1.50 m){margin}z is less than 0.40 m."),
    ],
)
def test_a_room_that_is_too_small_names_the_axis_and_the_bound(changes: dict[str, float], said: str) -> None:
    with pytest.raises(ApproachError) as caught:
        fit_approach(2.5, 55.0, RoomGeometry(**changes))
    parts = {
        "x": "x = -1.61 m (from -6.25 to 1.75 m)",
        "y": "y = 0.00 m (from -0.75 to 0.75 m)",
        "z": "z = 0.89 m (from 0.40 to 2.10 m)",
        "margin": ", which leaves 0.25 m to each wall: ",
    }
    assert f"it would start at {said.format(**parts)}" in str(caught.value)


@given(
    st.builds(
        RoomGeometry,
        x_min=st.floats(-3.0, 0.0),
        x_max=st.floats(-2.0, 2.0),
        y_min=st.floats(-1.0, 0.2),
        y_max=st.floats(-0.2, 1.0),
        ceiling_z=st.floats(0.9, 3.0),
    )
)
def test_a_start_is_outside_exactly_where_the_room_does_not_hold_it(room: RoomGeometry) -> None:
    start = plan_approach(2.0, 55.0, 0.0, room.ceiling_z, 3.0, 3.5, 0.3)
    inside = room.contains(start.x0, start.y0, start.z0, 0.25) and start.z0 >= 0.4
    assert (start_outside(start, room, 0.4, 0.25) is None) == inside


@pytest.mark.parametrize(
    ("speed", "angle_deg", "ceiling", "said"),
    [
        (math.nan, 55.0, 2.1, "approach: speed nan m/s; give a speed of more than 0"),
        (
            10.0,
            55.0,
            2.1,
            r"speed 10 m/s is too fast; .* less than 10 m/s\. What fits: 3.1 m",
        ),
        (2.5, math.nan, 2.1, "approach: angle nan deg; give an angle"),
        (2.5, 90.1, 2.1, "approach: angle 90.1 deg; give an angle"),
        (0.05, 10.0, 2.1, "climb at 0.05 m/s or more"),
        (0.5, 3.0, 2.1, r"climbs at 0.0262 m/s, .* at 0.5 m/s from 5.75 deg on"),
        (2.5, 0.87, 2.1, r"more than 1.57 and at most 90\. That looks like radians; .* \(49\.85\)$"),
        (2.5, 1.5, 2.1, r"looks like radians; write degrees \(85\.94\)$"),
        (250.0, 50.0, 2.1, r"too fast; .* looks like centimetres a second; write metres a second \(2\.5\)$"),
        (2500.0, 50.0, 2.1, r"millimetres a second; write metres a second \(2\.5\)$"),
        (2.5, 55.0, math.nan, "approach: the ceiling is at nan m; give a height"),
        (2.5, 55.0, 100.0, "approach: the ceiling is at 100.0 m; give a height"),
    ],
)
def test_what_is_absurd_is_named(speed: float, angle_deg: float, ceiling: float, said: str) -> None:
    with pytest.raises(ApproachError, match=said):
        fit_approach(speed, angle_deg, RoomGeometry(ceiling_z=ceiling))


@settings(max_examples=examples(30))
@given(st.floats(0.1, 20.0), st.floats(0.5, 90.0), st.floats(1.2, 3.0))
def test_what_is_offered_instead_fits(speed: float, angle_deg: float, ceiling: float) -> None:
    room = RoomGeometry(ceiling_z=ceiling)
    try:
        fit_approach(speed, angle_deg, room)
    except ApproachError as error:
        offered = str(error).partition("What fits: ")[2]
        for number, angle in re.findall(r"([\d.]+) m/s at ([\d.]+) deg", offered):
            fit_approach(float(number), float(angle), room)
        for height in re.findall(r"under a ceiling at ([\d.]+) m", offered):
            fit_approach(speed, angle_deg, replace(room, ceiling_z=float(height)))
