"""What is done to flights of a published simulator before they are judged; it flies in benchmarks alone."""

import math
import sys
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from tests.truth.airframe import Airframe, G
from tests.truth.lost import VehicleLost, check_kept
from tests.truth.mujoco_room import Hidden
from tests.truth.published import (
    RPM,
    PublishedRoom,
    RoomEnded,
    as_logged,
    flown_to_the_end,
    frame_of,
    owners_vehicle,
    speed_for,
)

PUBLISHED = {
    "mass": [0.04],
    "L": [0.035],
    "prop_inertia": [4e-8],
    "J": [[2e-5, 0.0, 0.0], [0.0, 2.5e-5, 0.0], [0.0, 0.0, 4e-5]],
    "rpm2thrust": [[0.001, -3e-7, 4.4e-10]],
    "rpm2torque": [[0.0, 1.7e-9, 2.5e-12]],
    "rotor_dyn_coef": [[14.0, 1e-4, 6.0, 3e-4]],
    "slowest": 7000.0,
    "fastest": 21_000.0,
}
CURVE = np.array(PUBLISHED["rpm2thrust"][0])


@pytest.fixture
def frame() -> Airframe:
    return frame_of(PUBLISHED)


def test_an_interpreter_without_the_simulator_is_told_of() -> None:
    with (
        pytest.raises(RoomEnded, match=r"crazyflow_room.py ended with 1: ModuleNotFoundError"),
        PublishedRoom(sys.executable),
    ):
        pytest.fail("it has nothing to fly with")


@pytest.mark.parametrize(("up", "lag"), [(True, "lag_up"), (False, "lag_down")])
def test_rotors_follow_a_small_step_about_hover_with_the_lag_of_the_file(
    frame: Airframe, up: bool, lag: str
) -> None:
    """The published law, integrated until 63 % of a step of 1 %."""
    hover = speed_for(CURVE, 0.04 * G / 4.0)
    linear, square = PUBLISHED["rotor_dyn_coef"][0][:2] if up else PUBLISHED["rotor_dyn_coef"][0][2:]
    goal, speed, time = hover * (1.01 if up else 0.99), hover, 0.0
    while abs(speed - hover) < (1.0 - math.exp(-1.0)) * abs(goal - hover):
        speed += 1e-5 * (linear * (goal - speed) + square * (goal**2 - speed**2))
        time += 1e-5
    assert time == pytest.approx(getattr(frame, lag), rel=0.01)


def follow(targets: np.ndarray, rates: Callable[[np.ndarray, np.ndarray], np.ndarray]) -> np.ndarray:
    """Values that follow `targets` (steps of 1 ms, rotors) at `rates` (of value and target, per s)."""
    value, values = targets[0].copy(), np.empty_like(targets)
    for row, target in enumerate(targets):
        values[row] = value
        value = value + 1e-3 * rates(value, target)
    return values


@pytest.mark.further
def test_its_rotors_bend_no_thrust_beside_their_laws() -> None:
    """The vehicle T350, whose rotors rise in first order and fall by drag: its owner's file, which says
    neither, lacks what looks like a bent map of -2 to -3 %, and with the laws that are fitted beside every
    name nothing of it."""
    told: dict[str, Any] = {
        **PUBLISHED,
        "mass": [0.0379],
        "rpm2thrust": [[0.0, -7.167e-7, 2.940e-10]],
        "rotor_dyn_coef": [[11.375, 0.0, 0.0, 3.787e-4]],
        "fastest": 25_992.0,
    }
    frame, curve = frame_of(told), np.array(told["rpm2thrust"][0])
    rng, hover = np.random.default_rng(1), 0.0379 * G / 4.0
    thrust = np.repeat(hover * rng.uniform(0.3, 1.9, (400, 4)), 50, axis=0)
    speed = np.vectorize(speed_for, signature="(n),()->()")(curve, thrust)
    up, down = told["rotor_dyn_coef"][0][0], told["rotor_dyn_coef"][0][3]
    flown = follow(speed, lambda w, s: np.where(s > w, up * (s - w), down * (s**2 - w**2)))
    flown = curve[0] + curve[1] * flown + curve[2] * flown**2

    def first_order(target: np.ndarray) -> np.ndarray:
        return follow(target, lambda f, t: (t - f) / np.where(t > f, frame.lag_up, frame.lag_down))

    def by_speed(drag_up: float, drag_down: float) -> np.ndarray:
        """Thrust where these shares of the lags near hover are the drag of the propeller's."""
        middle = math.sqrt(hover)

        def rates(w: np.ndarray, s: np.ndarray) -> np.ndarray:
            share = np.where(s > w, drag_up, drag_down)
            pull = (1.0 - share) * (s - w) + share * (s**2 - w**2) / (2.0 * middle)
            return np.asarray(pull / np.where(s > w, frame.lag_up, frame.lag_down))

        return follow(np.sqrt(thrust), rates) ** 2

    usual = first_order(thrust)
    bent = first_order(thrust * (thrust / hover)) - usual
    laws = [by_speed(*shares) - usual for shares in ((0.0, 0.0), (1.0, 1.0), (0.0, 1.0))]
    alone, beside = (
        np.linalg.lstsq(np.stack([c.ravel() for c in columns], axis=1), (flown - usual).ravel())[0]
        for columns in ([bent], [bent, *laws])
    )
    assert alone[0] < -0.01
    assert abs(beside[0]) < 0.002
    assert beside[3] == pytest.approx(1.0, abs=0.15)


def test_its_owner_knows_what_hovers_and_what_is_most(frame: Airframe) -> None:
    vehicle = owners_vehicle("test", PUBLISHED)
    assert vehicle.motors.thrust_max.value == pytest.approx(CURVE @ [1.0, 21e3, 21e3**2])
    speed = speed_for(CURVE, frame.mass * G / 4.0) * np.array([0.999, 1.001])
    torques, forces = 1.7e-9 * speed + 2.5e-12 * speed**2, 1e-3 - 3e-7 * speed + 4.4e-10 * speed**2
    assert frame.yaw_lever == pytest.approx(
        np.diff(torques)[0] / np.diff(forces)[0]
    )  # what yaws it in flight, with what rotors that speed up do
    assert np.diff(np.sqrt(forces / frame.kf))[0] == pytest.approx(np.diff(speed)[0] * RPM, rel=1e-3)
    assert {effect.name for effect in vehicle.effects} == {"rotor_gyroscopic", "rotor_acceleration_torque"}


def test_a_log_has_the_marker_that_cameras_see_and_duties_that_bring_the_thrust(frame: Airframe) -> None:
    """Heading east and 90 deg to the left, with a marker 10 mm ahead that is turned by 0.1 rad about b_z."""
    flown = np.zeros((2, 17))
    flown[0, 6] = 1.0
    flown[1, 5:7] = math.sin(math.pi / 4.0), math.cos(math.pi / 4.0)
    flown[:, 13:] = speed_for(CURVE, frame.mass * G / 4.0)
    hidden = Hidden(pose_offset=(0.01, 0.0, 0.0), pose_turn=(0.0, 0.0, 0.1))
    log = as_logged(flown, CURVE, frame, hidden)
    np.testing.assert_allclose(log[:, 1:4], [[0.01, 0.0, 0.0], [0.0, 0.01, 0.0]], atol=1e-12)
    half = [0.05, math.pi / 4.0 + 0.05]
    np.testing.assert_allclose(log[:, 6:8], np.column_stack([np.sin(half), np.cos(half)]))
    np.testing.assert_allclose(4.0 * frame.highest * log[:, 14:18] ** 2, frame.mass * G)


@pytest.mark.parametrize(("column", "value"), [(3, 0.0), (1, math.nan), (8, math.inf)])
def test_a_flight_that_ends_in_no_vehicle_is_no_flight(column: int, value: float) -> None:
    log = np.tile(np.array([0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0] + [0.0] * 10), (3, 5, 1))
    assert flown_to_the_end(log) is log
    lost = log.copy()
    lost[1, 4, [column, 6] if column == 3 else column] = value
    with pytest.raises(VehicleLost, match="flight 2 of 3"):
        flown_to_the_end(lost)


def test_flights_that_all_turn_over_are_no_set() -> None:
    level, over = np.array([[0.0, 0.0, 0.0, 1.0]] * 3), np.array([[0.0, 0.0, 0.0, 1.0], [0.8, 0.0, 0.0, 0.6]])
    check_kept([level, over])
    with pytest.raises(VehicleLost, match="all 2 flights"):
        check_kept([over, over])
