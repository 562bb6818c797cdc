"""Controller, mixer, flip, battery compensation, approach and braking in C, held to the reference."""

import ctypes
import math
from collections.abc import Callable, Iterable
from typing import Any

import numpy as np
import pytest

from onboard.battery import duty_for_thrust
from onboard.controller import attitude_control, geometric_control, lead_moments
from onboard.firmware.library import CoreLibrary, Float32Array, vehicle_constants
from onboard.firmware.structures import PerchPlan
from onboard.landing.braking import stopping_distance
from onboard.mixer import flip_thrusts, mix
from onboard.room import RoomGeometry
from onboard.trajectory import ApproachPlan, fit_approach, plan_from_velocity, smooth_approach
from onboard.vehicle import Vehicle
from tests.firmware.float32 import VEHICLES, address, floats, gains32, rounded, rounded_all, thrust_map32

SAMPLE, LONG = 5_000, 1_000_000
NAN, INF = math.nan, math.inf
BY_NAME = pytest.mark.parametrize("vehicle", VEHICLES, ids=lambda vehicle: vehicle.name)


def rows(states: Float32Array) -> list[list[float]]:
    """The float32 as the floats that they are."""
    return states.astype(np.float64).tolist()


def each(function: Callable[..., Iterable[float]], *arguments: Iterable[Any]) -> np.ndarray:
    """The reference, state by state."""
    with np.errstate(all="ignore"):
        return np.array([tuple(function(*some)) for some in zip(*arguments, strict=True)], dtype=np.float64)


def unit_quaternions(rng: np.random.Generator, count: int) -> Float32Array:
    q = rng.normal(size=(count, 4))
    return floats(q / np.linalg.norm(q, axis=1)[:, None], 4)


def random_states(seed: int, count: int) -> tuple[Float32Array, ...]:
    """Estimates (13), integrals (3), targets (9), headings (1): in a room, any attitude, 30 rad/s."""
    rng = np.random.default_rng(seed)
    estimates = np.hstack(
        [
            rng.uniform(-2.0, 2.0, (count, 3)),
            rng.normal(0.0, 2.0, (count, 3)),
            unit_quaternions(rng, count),
            rng.normal(0.0, 8.0, (count, 3)),
        ]
    )
    targets = estimates[:, :9].copy()
    targets[:, :6] += rng.normal(0.0, 0.3, (count, 6))
    targets[:, 6:] = rng.normal(0.0, 3.0, (count, 3))
    headings = np.where(rng.random(count) < 0.5, 0.0, rng.uniform(-4.0, 4.0, count))
    integrals = rng.uniform(-0.3, 0.3, (count, 3))
    return floats(estimates, 13), floats(integrals, 3), floats(targets, 9), floats(headings, 1)


def wrenches_in_c(core: CoreLibrary, vehicle: Vehicle, states: tuple[Float32Array, ...]) -> Float32Array:
    wrenches = np.empty((len(states[0]), 4), np.float32)
    arguments = [address(part) for part in states]
    core.perch_host_control(vehicle_constants(vehicle), len(wrenches), *arguments, address(wrenches))
    return wrenches


def wrenches_in_python(vehicle: Vehicle, states: tuple[Float32Array, ...]) -> np.ndarray:
    gains = gains32(vehicle)

    def one(e: list[float], integral: list[float], t: list[float], yaw: list[float]) -> tuple[float, ...]:
        estimate = (tuple(e[:3]), tuple(e[3:6]), tuple(e[6:10]), tuple(e[10:]))
        target = (tuple(t[:3]), tuple(t[3:6]), tuple(t[6:]))
        return geometric_control(*estimate, tuple(integral), *target, yaw[0], gains)

    return each(one, *map(rows, states))


def check_controller(core: CoreLibrary, vehicle: Vehicle, states: tuple[Float32Array, ...]) -> None:
    found, wanted = wrenches_in_c(core, vehicle, states), wrenches_in_python(vehicle, states)
    arm = min(vehicle.body.arm_x.value, vehicle.body.arm_y.value)
    assert np.abs(found[:, 0] - wanted[:, 0]).max() <= 1e-6
    # A moment as the force of a motor on its arm.
    assert np.abs(found[:, 1:] - wanted[:, 1:]).max() <= 1e-6 * arm


@BY_NAME
def test_controller(core: CoreLibrary, vehicle: Vehicle) -> None:
    check_controller(core, vehicle, random_states(1, SAMPLE // 3))


@pytest.mark.soak
def test_controller_in_a_million_states(core: CoreLibrary) -> None:
    for part in range(10):
        check_controller(core, VEHICLES[0], random_states(100 + part, LONG // 10))


def test_controller_at_the_edges(core: CoreLibrary) -> None:
    """Falls, turns upside down, wants to fall, wants to go sideways at once, and NaN in each number alone."""
    good, integral, target, yaw = (part[:1].copy() for part in random_states(2, 1))
    cases = []
    for i in range(13):
        for value in (NAN, 0.0, 3.0):
            state = good.copy()
            state[0, i] = value
            cases.append((state, integral, target, yaw))
    for i in range(9):
        for value in (NAN, 50.0, -50.0):
            wish = target.copy()
            wish[0, i] = value
            cases.append((good, integral, wish, yaw))
    states = tuple(np.ascontiguousarray(np.vstack(part)) for part in zip(*cases, strict=True))
    found, wanted = wrenches_in_c(core, VEHICLES[0], states), wrenches_in_python(VEHICLES[0], states)
    assert np.array_equal(np.isnan(found), np.isnan(wanted))
    assert np.isnan(found).any()
    assert np.nanmax(np.abs(found - wanted)) <= 1e-6


def test_level_attitude(core: CoreLibrary) -> None:
    estimates, _, _, yaws = random_states(3, SAMPLE // 3)
    collectives = floats(np.random.default_rng(3).uniform(0.0, 0.5, (len(yaws), 1)), 1)
    found = np.empty((len(yaws), 4), np.float32)
    core.perch_host_level(
        vehicle_constants(VEHICLES[0]),
        len(yaws),
        *map(address, (estimates, collectives, yaws, found)),
    )
    gains = gains32(VEHICLES[0])

    def one(e: list[float], collective: list[float], yaw: list[float]) -> tuple[float, ...]:
        return attitude_control(tuple(e[6:10]), tuple(e[10:]), collective[0], yaw[0], gains)

    wanted = each(one, rows(estimates), rows(collectives), rows(yaws))
    assert np.abs(found - wanted).max() <= 1e-6 * VEHICLES[0].body.arm_x.value


def test_lead_of_the_moments(core: CoreLibrary) -> None:
    """Its memory is the same after it, and what is not a number leaves it alone."""
    rng = np.random.default_rng(8)
    wrenches = floats(rng.normal(0.0, 5e-3, (SAMPLE // 3, 4)), 4)
    wrenches[:9, 1:] = [[NAN, 1e-3, 0.0], [INF, NAN, 1e-3], [0.0, 0.0, -INF]] * 3
    before = floats(rng.normal(0.0, 5e-3, (len(wrenches), 3)), 3)
    after, found = before.copy(), np.empty_like(wrenches)
    constants = vehicle_constants(VEHICLES[0])
    core.perch_host_lead(
        constants, len(found), address(wrenches), address(after), rounded(0.002), address(found)
    )
    gains = gains32(VEHICLES[0])

    def one(wrench: list[float], lagged: list[float]) -> tuple[float, ...]:
        leading, memory = lead_moments(tuple(wrench), tuple(lagged), gains, rounded(0.002))
        return (*leading, *memory)

    wanted = each(one, rows(wrenches), rows(before))
    both = np.hstack([found, after])
    assert np.array_equal(np.isfinite(both), np.isfinite(wanted))
    known = np.isfinite(wanted)
    assert np.abs(both[known] - wanted[known]).max() <= 1e-6 * VEHICLES[0].body.arm_x.value


def random_wrenches(vehicle: Vehicle, seed: int, count: int) -> Float32Array:
    """From none to twice what the motors give; a tenth at the corners of what they give."""
    rng = np.random.default_rng(seed)
    top, arm = vehicle.motors.thrust_max.value, vehicle.body.arm_x.value
    most = np.array([4.0 * top, 4.0 * top * arm, 4.0 * top * arm, 4.0 * top * 0.006])
    shares = rng.uniform(-0.5, 2.0, (count, 4)) * rng.choice([-1.0, 1.0], (count, 4))
    corners = rng.random(count) < 0.1
    shares[corners] = rng.choice([-1.0, -0.5, 0.0, 0.5, 1.0], (int(corners.sum()), 4))
    return floats(shares * most, 4)


def check_mixer(core: CoreLibrary, vehicle: Vehicle, wrenches: Float32Array) -> None:
    body, motors = vehicle.body, vehicle.motors
    constants = [
        rounded(part.value) for part in (body.arm_x, body.arm_y, motors.thrust_to_torque, motors.thrust_max)
    ]
    found = np.empty((len(wrenches), 4), np.float32)
    core.perch_host_mix(vehicle_constants(vehicle), len(wrenches), address(wrenches), address(found))
    wanted = each(lambda wrench: mix(*wrench, *constants), rows(wrenches))
    assert np.array_equal(np.isnan(found), np.isnan(wanted))
    assert np.nanmax(np.abs(found - wanted)) <= 1e-6
    assert not (found < 0.0).any()
    assert not (found > np.float32(motors.thrust_max.value)).any()


@BY_NAME
def test_mixer(core: CoreLibrary, vehicle: Vehicle) -> None:
    check_mixer(core, vehicle, random_wrenches(vehicle, 4, SAMPLE))


@pytest.mark.soak
def test_mixer_of_a_million_wrenches(core: CoreLibrary) -> None:
    for part in range(10):
        check_mixer(core, VEHICLES[0], random_wrenches(VEHICLES[0], 200 + part, LONG // 10))


def test_mixer_of_what_is_not_a_number(core: CoreLibrary) -> None:
    edges = (0.0, 1e-3, NAN, INF, -INF)
    every = ((c, x, y, z) for c in edges for x in edges for y in edges for z in edges)
    check_mixer(core, VEHICLES[0], floats(every, 4))


@BY_NAME
def test_flip(core: CoreLibrary, vehicle: Vehicle) -> None:
    moments = floats([*np.linspace(-0.02, 0.02, 401), 0.0, -0.0, NAN, INF, -INF], 1)
    found = np.empty((len(moments), 4), np.float32)
    core.perch_host_flip(vehicle_constants(vehicle), len(moments), address(moments), address(found))
    arm, top = rounded(vehicle.body.arm_x.value), rounded(vehicle.motors.thrust_max.value)
    wanted = each(lambda moment: (min(f, top) for f in flip_thrusts(moment[0], arm)), rows(moments))
    assert np.abs(found - wanted).max() <= 1e-8


@BY_NAME
def test_battery_compensation(core: CoreLibrary, vehicle: Vehicle) -> None:
    rng = np.random.default_rng(5)
    top, least = vehicle.motors.thrust_max.value, rounded(vehicle.motors.thrust_min.value)
    thrusts = [*rng.uniform(0.0, 1.2 * top, SAMPLE // 3), 0.0, least, top, -0.1, NAN, INF, 0.1, 0.1, 0.1]
    voltages = [*rng.uniform(2.5, 4.3, SAMPLE // 3), 4.0, 4.0, 4.0, 4.0, 4.0, 4.0, NAN, 1.99, 0.0]
    pairs = floats(zip(thrusts, voltages, strict=True), 2)
    asked, supply = (np.ascontiguousarray(pairs[:, i]) for i in (0, 1))
    found = np.empty(len(pairs), np.float32)
    core.perch_host_duty(vehicle_constants(vehicle), len(pairs), *map(address, (asked, supply, found)))
    thrust_map = thrust_map32(vehicle)
    wanted = each(lambda pair: (duty_for_thrust(*pair, thrust_map, least),), rows(pairs))[:, 0]
    assert np.abs(found - wanted).max() <= 2e-6  # an eighth of a step of the 16-bit command
    assert found.max() <= 1.0


def plans(count: int, seed: int) -> Float32Array:
    """What the ground may say about an approach: vx, vz, impact x and y, ceiling, ax, az, tau0."""
    rng = np.random.default_rng(seed)
    lows = (0.0, 0.5, -1.0, -1.0, 1.5, 0.5, 2.0, 0.2)
    highs = (4.0, 4.0, 1.0, 1.0, 4.0, 4.0, 5.0, 0.6)
    return floats(rng.uniform(lows, highs, (count, 8)), 8)


def test_plans(core: CoreLibrary) -> None:
    some = plans(SAMPLE // 5, 6)
    found = np.empty((len(some), 12), np.float32)
    core.perch_host_plan(len(some), address(some), address(found))
    wanted = each(lambda numbers: plan_from_velocity(*numbers), rows(some))
    assert np.abs(found - wanted).max() <= 2e-5


@pytest.mark.parametrize("values", [(0.0, 3.0), (-1.0, 3.0), (NAN, 3.0), (1.0, 0.0), (1.0, NAN)])
def test_accelerations_that_make_no_plan(core: CoreLibrary, values: tuple[float, float]) -> None:
    numbers = floats([(1.0, 2.0, 0.0, 0.0, 2.1, *values, 0.5)], 8)
    found = np.zeros((1, 12), np.float32)
    core.perch_host_plan(1, address(numbers), address(found))
    assert np.isnan(found).all()


@pytest.mark.parametrize(("speed", "angle"), [(1.5, 90.0), (2.5, 50.0), (3.5, 60.0)])
def test_rounded_off_approach(core: CoreLibrary, speed: float, angle: float) -> None:
    fitted = fit_approach(speed, angle, RoomGeometry(ceiling_z=3.0, x_min=-4.0, x_max=4.0))
    plan: ApproachPlan = rounded_all(fitted)
    times = floats(np.linspace(-0.5, plan.impact_time + 0.5, 2000), 1)
    motions, jerks = np.empty((len(times), 9), np.float32), np.empty(len(times), np.float32)
    core.perch_host_approach(
        ctypes.byref(PerchPlan(*plan)), len(times), address(times), 0.08, address(motions), address(jerks)
    )

    def one(t: list[float]) -> tuple[float, ...]:
        position, velocity, acceleration, jerk = smooth_approach(plan, t[0], rounded(0.08))
        return (*position, *velocity, *acceleration, jerk[2])

    wanted = each(one, rows(times))
    limits = np.array([2e-6] * 3 + [2e-6] * 3 + [1e-5] * 3)  # m, m/s, m/s2
    assert (np.abs(motions - wanted[:, :9]).max(axis=0) <= limits).all()
    # Where a step of the jerk lies between two float32 times, its value may be either.
    assert np.mean(np.abs(jerks - wanted[:, 9]) > 1e-3) < 0.005


def test_stopping_distance(core: CoreLibrary) -> None:
    rng = np.random.default_rng(7)
    states = floats(rng.uniform((-1.0, -9.0, 0.02), (5.0, 8.0, 0.25), (SAMPLE // 3, 3)), 3)
    found = np.empty(len(states), np.float32)
    core.perch_host_stopping(len(states), address(states), address(found))
    wanted = each(lambda state: (stopping_distance(*state),), rows(states))[:, 0]
    assert np.abs(found - wanted).max() <= 2e-6
