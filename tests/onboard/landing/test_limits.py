"""Each limit of the landing machine: what it is, just inside, just outside, and at it."""

import math
from typing import Any

import pytest

from onboard.app_interface import TrajectoryStatus
from onboard.landing.braking import stopping_distance
from onboard.landing.state_machine import EndReason, LandingState, landing_limits
from onboard.rotation import body_z, from_rotation_vector
from onboard.trajectory import sample_approach
from onboard.vehicle import load_vehicle
from tests.onboard.landing.exact import (
    A_BIT,
    AXES,
    BAD_ESTIMATE,
    CONTACT,
    EXACT_LIMITS,
    EXACT_PLAN,
    GOES_ON,
    LEVEL_FLIGHT,
    MISSED,
    OFF_TRACK,
    POSE_LOST,
    STEP,
    after,
    exact_rig,
    tip_over,
)
from tests.onboard.landing.rig import LIMITS, NAN, PLAN, Rig


def moved(place: tuple[float, ...], axis: int, by: float) -> tuple[float, ...]:
    return tuple(value + by * (i == axis) for i, value in enumerate(place))


def test_the_limits_of_a_vehicle() -> None:
    vehicle = load_vehicle("crazyflie21-upgraded")
    body, motors = vehicle.body, vehicle.motors
    top = max(body.body_top_z.value, body.propeller_height_z.value)
    assert top > min(body.body_top_z.value, body.propeller_height_z.value)
    assert landing_limits(vehicle, 0.2)._asdict() == pytest.approx(
        {
            "arm_x": body.arm_x.value,
            "thrust_max": motors.thrust_max.value,
            "weight": body.mass.value * 9.81,
            "policy_tau_min": 0.2,
            "start_distance": 0.25,
            "start_speed": 0.3,
            "start_z_min": 0.2,
            "motor_lag": motors.time_constant_down.value,
            "motor_lag_up": motors.time_constant_up.value,
            "smoothing": 0.08,
            "latency": 0.02,
            "thrust_reserve": 0.5,
            "brake_margin": top + 0.06,
            "contact_distance": top + 0.01,
            "tilt_limit": math.radians(70.0),
            "flip_timeout": 0.5,
            "pose_age_limit": 0.15,
            "speed_limit": 5.0,
            "hold_distance": 1.0,
            "useless_limit": 0.5,
            "lateral_limit": 0.5,
            "hold_clearance": 0.7,
            "hold_acceleration": 4.0,
            "descent_speed": 0.5,
        }
    )
    assert math.isnan(landing_limits(vehicle).policy_tau_min)


# --- the start --------------------------------------------------------------------------------------------


@pytest.mark.parametrize("axis", range(3))
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_how_near_the_start_is_near_enough(axis: int, sign: float) -> None:
    for distance, near in ((0.245, True), (0.255, False)):
        position = moved((PLAN.x0, PLAN.y0, PLAN.z0), axis, sign * distance)
        rig = Rig()
        rig.step(trajectory_armed=True, position=position)
        assert (rig.status is TrajectoryStatus.ARMED) == near
        assert (rig.status is TrajectoryStatus.REFUSED_TOO_FAR) == (not near)
        rig = Rig()
        rig.step(trajectory_armed=True)
        rig.step(go=True, position=position)
        assert (rig.state is LandingState.APPROACH) == near


@pytest.mark.parametrize(("each", "near"), [(0.14, True), (0.15, False)])
def test_nearness_is_a_distance_in_space(each: float, near: bool) -> None:
    rig = Rig()
    rig.step(trajectory_armed=True, position=(PLAN.x0 + each, PLAN.y0 - each, PLAN.z0 + each))
    assert (rig.status is TrajectoryStatus.ARMED) == near


@pytest.mark.parametrize("axis", range(3))
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_how_slow_is_slow_enough_for_go(axis: int, sign: float) -> None:
    for speed, slow in ((0.295, True), (0.305, False)):
        rig = Rig()
        rig.step(trajectory_armed=True)
        rig.step(go=True, velocity=moved((0.0, 0.0, 0.0), axis, sign * speed))
        assert (rig.state is LandingState.APPROACH) == slow


@pytest.mark.parametrize(("each", "slow"), [(0.17, True), (0.18, False)])
def test_slowness_is_a_speed_in_space(each: float, slow: bool) -> None:
    rig = Rig()
    rig.step(trajectory_armed=True)
    rig.step(go=True, velocity=(each, -each, each))
    assert (rig.state is LandingState.APPROACH) == slow


@pytest.mark.parametrize(("name", "limit"), [("pose_age", 0.15), ("velocity", 0.3)])
def test_a_little_more_than_the_limit_is_no_go(name: str, limit: float) -> None:
    for share, goes in ((0.98, True), (1.02, False)):
        rig = Rig()
        rig.step(trajectory_armed=True)
        value = (share * limit, 0.0, 0.0) if name == "velocity" else share * limit
        rig.step(go=True, **{name: value})
        assert (rig.state is LandingState.APPROACH) == goes


def test_at_the_limits_of_the_start_it_goes_and_a_bit_beyond_it_does_not() -> None:
    x, y, z = EXACT_PLAN.x0, EXACT_PLAN.y0, EXACT_PLAN.z0
    at_limit: dict[str, Any] = {"position": (x, y, z + 0.25), "velocity": (0.0, 0.25, 0.0), "pose_age": 0.125}
    beyond: dict[str, Any] = {
        "position": (x, y, z + 0.25 + A_BIT),
        "velocity": (0.0, 0.25 + A_BIT, 0.0),
        "pose_age": 0.125 + A_BIT,
    }
    rig = exact_rig()
    rig.step(trajectory_armed=True, **at_limit)
    assert rig.state is LandingState.TRAJECTORY_ARMED
    rig.step(go=True)
    assert rig.state is LandingState.APPROACH
    for name, value in beyond.items():
        rig = exact_rig()
        rig.step(trajectory_armed=True)
        rig.step(go=True, **{**at_limit, name: value})
        assert rig.state is LandingState.TRAJECTORY_ARMED, name


@pytest.mark.parametrize(("z0", "sound"), [(0.195, False), (0.205, True)])
def test_the_lowest_start(z0: float, sound: bool) -> None:
    rig = Rig(PLAN._replace(z0=z0))
    rig.step(trajectory_armed=True)
    assert (rig.status is TrajectoryStatus.ARMED) == sound


# --- the approach -----------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("changes", "end"),
    [
        ({"pose_age": 0.147}, GOES_ON),
        ({"pose_age": 0.153}, POSE_LOST),
        ({"pose_age": NAN}, POSE_LOST),
        ({"position": (-1.0, 0.49, 1.0)}, GOES_ON),
        ({"position": (-1.0, 0.51, 1.0)}, OFF_TRACK),
        ({"position": (-1.0, -0.49, 1.0)}, GOES_ON),
        ({"position": (-1.0, -0.51, 1.0)}, OFF_TRACK),
        ({"position": (-1.0, 0.0, 2.1 - 1.02 * LIMITS.contact_distance), "velocity": LEVEL_FLIGHT}, GOES_ON),
        ({"position": (-1.0, 0.0, 2.1 - 0.98 * LIMITS.contact_distance), "velocity": LEVEL_FLIGHT}, CONTACT),
    ],
)
def test_what_an_approach_bears(changes: dict[str, Any], end: tuple[LandingState, EndReason]) -> None:
    assert after(Rig(), 1.0, **changes) == end


@pytest.mark.parametrize("name", ["position", "velocity", "quaternion", "gyro"])
@pytest.mark.parametrize("bad", [NAN, math.inf, -math.inf])
def test_no_part_of_the_estimate_may_be_unknown(name: str, bad: float) -> None:
    for part in range(len(getattr(Rig().inputs, name))):
        rig = Rig()
        known = getattr(rig.inputs, name)
        broken = tuple(bad if i == part else value for i, value in enumerate(known))
        assert after(rig, 1.0, **{name: broken}) == BAD_ESTIMATE, part
        if name != "gyro":
            rig = Rig()
            rig.step(trajectory_armed=True)
            rig.step(go=True, **{name: broken})
            assert rig.state is LandingState.TRAJECTORY_ARMED, part


def test_a_clock_that_is_no_number_ends_the_approach() -> None:
    assert after(Rig(), 1.0, time=NAN) == BAD_ESTIMATE


def test_at_the_limits_of_the_approach_it_goes_on_and_a_bit_beyond_it_does_not() -> None:
    assert after(exact_rig(), 0.5, pose_age=0.125) == GOES_ON
    assert after(exact_rig(), 0.5, pose_age=0.125 + A_BIT) == POSE_LOST
    for y in (0.0, 1.0):
        assert after(exact_rig(), 0.5, position=(0.0, y, 0.5)) == GOES_ON
        beyond = y + math.copysign(A_BIT, y - 0.5)
        assert after(exact_rig(), 0.5, position=(0.0, beyond, 0.5)) == OFF_TRACK
    ceiling = EXACT_PLAN.ceiling_z
    assert (
        after(exact_rig(), 0.5, position=(0.0, 0.5, ceiling - 0.0625 - A_BIT), velocity=LEVEL_FLIGHT)
        == GOES_ON
    )
    assert after(exact_rig(), 0.5, position=(0.0, 0.5, ceiling - 0.0625), velocity=LEVEL_FLIGHT) == CONTACT


def test_an_approach_lasts_half_a_second_longer_than_planned_and_no_longer() -> None:
    still: dict[str, Any] = {"position": (0.0, 0.5, 0.5), "velocity": (0.0, 0.0, 0.0)}
    for extra, end in ((0.5, GOES_ON), (0.5 + STEP, OFF_TRACK)):
        rig = exact_rig()
        rig.approach(0.5)
        start = rig.inputs.time - 0.5
        rig.step(time=start + EXACT_PLAN.impact_time + extra, **still)
        assert (rig.state, rig.reason) == end


@pytest.mark.parametrize("axis", AXES)
def test_how_far_a_vehicle_may_tilt_in_the_approach(axis: tuple[float, float, float]) -> None:
    for tilt, upright in ((69.0, True), (71.0, False)):
        rig = Rig()
        rig.step(quaternion=from_rotation_vector(tuple(math.radians(tilt) * part for part in axis)))
        rig.approach(1.0)
        assert rig.state is (LandingState.APPROACH if upright else LandingState.CUT)


@pytest.mark.parametrize("axis", AXES)
@pytest.mark.parametrize("where", [Rig.brake, Rig.hold])
def test_how_far_a_vehicle_may_tilt_in_a_brake(where: Any, axis: tuple[float, float, float]) -> None:
    for tilt, upright in ((69.0, True), (71.0, False)):
        rig = Rig()
        where(rig)
        before = rig.state
        rig.step(**tip_over(tilt, axis))
        assert rig.state is (before if upright else LandingState.CUT)


def test_at_the_limit_of_tilt_a_vehicle_is_tilted() -> None:
    rig = Rig(limits=LIMITS._replace(tilt_limit=0.0))
    rig.approach(1.0)
    assert (rig.state, rig.reason) == (LandingState.CUT, EndReason.TILT)


def test_at_the_horizon_a_flip_is_over() -> None:
    """An attitude with b3.z of exactly 0."""
    rig = Rig()
    rig.flip()
    rig.memory["attitude"][:] = 0.5
    rig.step()
    assert rig.state is LandingState.CUT


def test_at_60_deg_nothing_triggers() -> None:
    """An attitude with b3.z of exactly 0.5."""
    rig = Rig()
    rig.step(quaternion=(0.5, 0.0, 0.5, math.sqrt(0.5)))
    rig.approach(PLAN.impact_time - 0.251, policy_armed=True)
    rig.step(**rig.trigger_sample())
    assert body_z(rig.memory["attitude"])[2] == 0.5
    assert rig.memory["snapshot_count"] == 0


@pytest.mark.parametrize(("tilt", "fires"), [(59.0, True), (61.0, False)])
def test_how_far_a_vehicle_may_tilt_at_the_trigger(tilt: float, fires: bool) -> None:
    rig = Rig()
    rig.step(quaternion=from_rotation_vector((math.radians(tilt), 0.0, 0.0)))
    rig.approach(PLAN.impact_time - 0.251, policy_armed=True)
    rig.step(**rig.trigger_sample())
    assert (rig.state is LandingState.FLIP) == fires


# --- the missed trigger -----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("evaluated", "left", "missed"),
    [(True, 0.2162, False), (True, 0.2158, True), (False, 0.2062, False), (False, 0.2058, True)],
)
def test_the_end_of_the_policys_range(evaluated: bool, left: float, missed: bool) -> None:
    """`left`: s to the ceiling. Once the policy has looked, it looks again 10 ms later."""
    end = after_armed(Rig(), left, evaluated)
    assert end == (MISSED if missed else GOES_ON)


def after_armed(rig: Rig, left: float, evaluated: bool) -> tuple[LandingState, EndReason]:
    rig.approach(rig.plan.impact_time - 0.3, policy_armed=True)
    position, velocity, _ = sample_approach(rig.plan, rig.plan.impact_time - left)
    rig.step(position=position, velocity=velocity, evaluated=evaluated)
    return rig.state, rig.reason


def test_at_the_end_of_the_policys_range_the_next_look_may_still_fire() -> None:
    for left, end in ((0.25, GOES_ON), (0.25 - A_BIT, MISSED)):
        rig = exact_rig()
        rig.approach(EXACT_PLAN.impact_time - 0.375, policy_armed=True)
        place = (0.0, 0.5, EXACT_PLAN.ceiling_z - left)
        rig.step(position=place, velocity=(1.0, 0.0, 1.0), evaluated=False)
        assert (rig.state, rig.reason) == end


def rise(speed: float, acceleration: float) -> float:
    """Rise (m) of a body whose thrust falls with 0.15 s, by integration."""
    z, v, a, dt = 0.0, speed, acceleration, 1e-4
    while v > 0.0:
        z += (v + 0.5 * a * dt) * dt
        v += a * dt
        a += (-9.81 - a) * dt / 0.15
    return z


@pytest.mark.parametrize("climbing", [True, False])
@pytest.mark.parametrize("speed", [0.5, 1.5, 3.0])
def test_where_an_approach_without_policy_brakes(speed: float, climbing: bool) -> None:
    """At the distance that stopping takes: 20 ms of latency, thrust of the plan and a reserve, a margin."""
    end_of_climb = PLAN.t_x + PLAN.t_z + 0.16
    elapsed = end_of_climb - 2e-3 if climbing else end_of_climb + 2e-3
    demand = rise(speed, 0.5 + (PLAN.az if climbing else 0.0)) + 0.02 * speed + LIMITS.brake_margin
    for share, end in ((1.01, GOES_ON), (0.99, MISSED)):
        place = (PLAN.impact_x, 0.0, PLAN.ceiling_z - share * demand)
        rig = Rig()
        rig.approach(0.5)
        start = rig.inputs.time - 0.5
        rig.step(time=start + elapsed, position=place, velocity=(0.0, 0.0, speed))
        assert (rig.state, rig.reason) == end


def test_at_the_end_of_the_climb_only_the_reserve_is_left_to_stop() -> None:
    limits = EXACT_LIMITS._replace(smoothing=0.0625, policy_tau_min=NAN)
    end_of_climb = EXACT_PLAN.t_x + EXACT_PLAN.t_z + 0.125
    demands = [rise(1.0, acceleration) for acceleration in (0.5, 0.5 + EXACT_PLAN.az)]
    left = sum(demands) / 2.0 + 0.02 + limits.brake_margin
    for elapsed, end in ((end_of_climb - STEP, MISSED), (end_of_climb, GOES_ON)):
        rig = exact_rig(limits)
        rig.approach(0.5)
        start = rig.inputs.time - 0.5
        place = (0.0, 0.5, EXACT_PLAN.ceiling_z - left)
        rig.step(time=start + elapsed, position=place, velocity=(0.0, 0.0, 1.0))
        assert (rig.state, rig.reason) == end


@pytest.mark.parametrize(("climb", "end"), [(0.0, GOES_ON), (-0.5, GOES_ON), (0.3, MISSED)])
def test_only_a_climb_must_be_stopped(climb: float, end: tuple[LandingState, EndReason]) -> None:
    within_the_margin = PLAN.ceiling_z - 0.5 * (LIMITS.brake_margin + LIMITS.contact_distance)
    state = after(Rig(), 1.0, position=(0.0, 0.0, within_the_margin), velocity=(1.0, 0.0, climb))
    assert state == end


@pytest.mark.parametrize("lag", [0.03, 0.15, 0.4])
@pytest.mark.parametrize("acceleration", [-9.0, -1.0, 3.6, 10.0])
@pytest.mark.parametrize("speed", [1e-3, 0.3, 4.0])
def test_a_stop_is_where_the_speed_is_gone(speed: float, acceleration: float, lag: float) -> None:
    """The same fall backwards: from the apex, the height and the speed of the start come out again."""
    push = (9.81 + acceleration) * lag
    low, high = 0.0, (speed + push) / 9.81
    for _ in range(200):
        t = 0.5 * (low + high)
        v = speed + push * (1.0 - math.exp(-t / lag)) - 9.81 * t
        low, high = (t, high) if v > 0.0 else (low, t)
    apex = speed * t + push * (t - lag * (1.0 - math.exp(-t / lag))) - 0.5 * 9.81 * t * t
    assert stopping_distance(speed, acceleration, lag) == pytest.approx(apex, rel=1e-3, abs=1e-9)


def test_what_does_not_climb_needs_no_distance() -> None:
    for speed in (0.0, -1e-9, -0.5, NAN):
        assert stopping_distance(speed, 3.6, 0.15) == 0.0
