"""The way from state to state, and what the drone is told to do in each."""

import math
from typing import Any

import pytest

from onboard.app_interface import TrajectoryStatus
from onboard.landing.state_machine import EndReason, LandingOutput, LandingState, OutputMode
from onboard.rotation import from_rotation_vector
from onboard.trajectory import ApproachPlan, smooth_approach
from tests.onboard.landing.rig import LEVEL, LIMITS, NAN, PLAN, Rig, steps_until_cut

ZERO = (0.0, 0.0, 0.0)
NO_THRUSTS = (0.0, 0.0, 0.0, 0.0)


def idle(rig: Rig) -> LandingOutput:
    return rig.step()


def armed(rig: Rig) -> LandingOutput:
    return rig.step(trajectory_armed=True)


def cut(rig: Rig) -> LandingOutput:
    rig.flip()
    return rig.step(abort=True)


def fault(rig: Rig) -> LandingOutput:
    rig.brake()
    rig.step(time=rig.inputs.time + 1.0, position=(NAN, NAN, NAN))
    output = rig.step()
    assert rig.state is LandingState.FAULT
    return output


def test_the_modes_by_their_numbers() -> None:
    """They are shared with code that knows no names."""
    assert {mode.name: int(mode) for mode in OutputMode} == {
        "PASS": 0,
        "SETPOINT": 1,
        "LEVEL": 2,
        "THRUSTS": 3,
        "OFF": 4,
    }


@pytest.mark.parametrize(
    ("reach", "mode"),
    [
        (idle, OutputMode.PASS),
        (armed, OutputMode.PASS),
        (Rig.brake, OutputMode.LEVEL),
        (cut, OutputMode.OFF),
        (fault, OutputMode.OFF),
    ],
)
def test_where_nothing_is_tracked_nothing_is_asked_of_the_motors(reach: Any, mode: OutputMode) -> None:
    output = reach(Rig())
    assert output.mode == mode
    assert (output.position, output.velocity, output.acceleration) == (ZERO, ZERO, ZERO)
    assert (output.yaw, output.collective, output.thrusts) == (0.0, 0.0, NO_THRUSTS)
    assert output.attitude == pytest.approx(LEVEL)


@pytest.mark.parametrize("reach", [Rig.approach, Rig.hold])
def test_a_setpoint_leaves_the_thrusts_to_the_controller(reach: Any) -> None:
    output = reach(Rig())
    assert output.mode == OutputMode.SETPOINT
    assert (output.yaw, output.collective, output.thrusts) == (0.0, 0.0, NO_THRUSTS)


@pytest.mark.parametrize("a_rot", [-7e-3, 7e-3])
def test_a_flip_turns_as_the_policy_says(a_rot: float) -> None:
    rig = Rig()
    rig.approach(PLAN.impact_time - 0.251, policy_armed=True)
    output = rig.step(**{**rig.trigger_sample(), "a_rot": a_rot})
    each = 7e-3 / (2 * LIMITS.arm_x)
    front = (each, 0.0, 0.0, each)
    assert output.mode == OutputMode.THRUSTS
    assert output.thrusts == pytest.approx(front if a_rot < 0.0 else (0.0, each, each, 0.0))
    assert (output.position, output.velocity, output.acceleration) == (ZERO, ZERO, ZERO)
    assert (output.yaw, output.collective) == (0.0, 0.0)
    rig.step(a_rot=-a_rot)
    assert rig.step().thrusts == output.thrusts, "what was triggered is flown to the end"


@pytest.mark.parametrize("a_rot", [-1.0, 1.0])
def test_no_motor_is_asked_for_more_than_it_can(a_rot: float) -> None:
    rig = Rig()
    rig.approach(PLAN.impact_time - 0.251, policy_armed=True)
    most = LIMITS.thrust_max
    expected = (most, 0.0, 0.0, most) if a_rot < 0.0 else (0.0, most, most, 0.0)
    assert rig.step(**{**rig.trigger_sample(), "a_rot": a_rot}).thrusts == pytest.approx(expected)


@pytest.mark.parametrize("share", [0.1, 0.5, 0.9])
@pytest.mark.parametrize("plan", [PLAN, PLAN._replace(az=0.1, vz=0.05, t_z=0.5)], ids=["steep", "gentle"])
def test_thrust_leads_the_plan_by_the_motors_lag(plan: ApproachPlan, share: float) -> None:
    """Rising thrust by the lag of rising motors, falling thrust by that of falling ones."""
    width = 2.0 * LIMITS.smoothing
    for begin, lag in (
        (plan.t_x, LIMITS.motor_lag_up),
        (plan.t_x + plan.t_z, LIMITS.motor_lag),
    ):
        rig = Rig(plan)
        output = rig.approach(begin + share * width)
        position, velocity, acceleration, jerk = smooth_approach(
            plan, begin + share * width - LIMITS.smoothing, LIMITS.smoothing
        )
        assert abs(jerk[2]) == pytest.approx(plan.az / width)
        assert output.position == pytest.approx(position)
        assert output.velocity == pytest.approx(velocity)
        wanted = (acceleration[0], acceleration[1], acceleration[2] + lag * jerk[2])
        assert output.acceleration == pytest.approx(wanted)


# --- from state to state ----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("changes", "reason"),
    [
        ({"abort": True}, EndReason.ABORT),
        ({"trajectory_armed": False}, EndReason.DISARMED),
        ({"flying": False}, EndReason.DISARMED),
    ],
)
def test_what_ends_an_armed_trajectory(changes: dict[str, Any], reason: EndReason) -> None:
    rig = Rig()
    armed(rig)
    rig.step(**changes)
    assert (rig.state, rig.reason, rig.status) == (LandingState.IDLE, reason, TrajectoryStatus.NONE)
    rig.step(abort=False, trajectory_armed=False, flying=True)
    assert rig.reason is reason, "it stays readable"
    armed(rig)
    assert (rig.state, rig.reason) == (LandingState.TRAJECTORY_ARMED, EndReason.NONE)


def test_without_go_an_armed_trajectory_waits() -> None:
    rig = Rig()
    armed(rig)
    for _ in range(5):
        assert rig.step().mode == OutputMode.PASS
        assert rig.state is LandingState.TRAJECTORY_ARMED
    rig.step(go=True)
    assert rig.state is LandingState.APPROACH


def test_the_approach_says_that_it_flies() -> None:
    rig = Rig()
    rig.approach(0.5)
    assert (rig.status, rig.reason) == (TrajectoryStatus.FLYING, EndReason.NONE)


@pytest.mark.parametrize(
    ("changes", "state", "reason"),
    [
        ({"flying": False}, LandingState.CUT, EndReason.NOT_FLYING),
        ({"position": (0.0, 0.0, PLAN.ceiling_z)}, LandingState.BRAKE, EndReason.CONTACT),
        ({"abort": True}, LandingState.BRAKE, EndReason.ABORT),
        ({"trajectory_armed": False}, LandingState.BRAKE, EndReason.DISARMED),
        ({"pose_age": 1.0}, LandingState.BRAKE, EndReason.POSE_LOST),
        ({"position": (0.0, 1.0, 1.0)}, LandingState.BRAKE, EndReason.OFF_TRACK),
    ],
)
def test_an_approach_that_has_ended_does_not_say_that_it_flies(
    changes: dict[str, Any], state: LandingState, reason: EndReason
) -> None:
    rig = Rig()
    rig.approach(0.5)
    rig.step(**changes)
    assert (rig.state, rig.reason, rig.status) == (state, reason, TrajectoryStatus.NONE)
    rig.step()
    assert rig.reason is reason


def test_a_trigger_ends_the_approach_and_says_so() -> None:
    rig = Rig()
    rig.flip()
    assert (rig.reason, rig.status) == (EndReason.TRIGGERED, TrajectoryStatus.NONE)
    steps_until_cut(rig)
    assert rig.reason is EndReason.TRIGGERED


@pytest.mark.parametrize("pitch", [0.3, -0.3])
def test_the_snapshot_keeps_the_own_pitch_nose_down_positive(pitch: float) -> None:
    rig = Rig()
    rig.step(quaternion=from_rotation_vector((0.0, pitch, 0.0)))
    rig.flip()
    assert rig.memory["snapshot_pitch"] == pytest.approx(pitch, abs=1e-6)


def test_flips_are_counted() -> None:
    rig = Rig()
    for count in (1, 2):
        rig.flip()
        assert rig.memory["snapshot_count"] == count
        rig.step(abort=True)
        rig.step(abort=False, policy_armed=False, trajectory_armed=False, flying=False, evaluated=False)
        assert rig.state is LandingState.IDLE
        rig.inputs = rig.inputs._replace(
            flying=True, position=(PLAN.x0, PLAN.y0, PLAN.z0), velocity=(0.0, 0.0, 0.0)
        )


@pytest.mark.parametrize("climb", [0.5, 1e-3])
def test_a_slow_climb_may_trigger(climb: float) -> None:
    rig = Rig()
    rig.approach(PLAN.impact_time - 0.251, policy_armed=True)
    rig.step(**{**rig.trigger_sample(), "velocity": (1.9, 0.0, climb)})
    assert rig.state is LandingState.FLIP


@pytest.mark.parametrize(
    "barely",
    [{"trigger_value": 0.0}, {"tau": 1e-3}, {"tau": 5.0}, {"d_ceil": 1e-3}, {"a_rot": -1e-9}, {"a_rot": 0.5}],
)
def test_what_barely_triggers(barely: dict[str, Any]) -> None:
    rig = Rig()
    rig.approach(PLAN.impact_time - 0.251, policy_armed=True)
    rig.step(**{**rig.trigger_sample(), **barely})
    assert rig.state is LandingState.FLIP


@pytest.mark.parametrize(
    "denial",
    [
        {"tau": -0.25},
        {"tau": -math.inf},
        {"d_ceil": 0.0},
        {"d_ceil": math.inf},
        {"a_rot": -math.inf},
        {"velocity": (1.9, 0.0, 0.0)},
    ],
)
def test_what_does_not_trigger(denial: dict[str, Any]) -> None:
    rig = Rig()
    rig.approach(PLAN.impact_time - 0.251, policy_armed=True)
    rig.step(**{**rig.trigger_sample(), **denial})
    assert rig.memory["snapshot_count"] == 0
    assert rig.state is not LandingState.FLIP


def test_without_an_attitude_nothing_triggers() -> None:
    """All zeros are finite and no attitude."""
    rig = Rig()
    rig.step(quaternion=NO_THRUSTS)
    rig.approach(PLAN.impact_time - 0.251, policy_armed=True)
    rig.step(**rig.trigger_sample())
    assert rig.memory["snapshot_count"] == 0


@pytest.mark.parametrize("reach", [cut, fault])
@pytest.mark.parametrize("held", ["trajectory_armed", "policy_armed", "flying"])
def test_stopped_motors_stay_stopped_until_all_is_clear(reach: Any, held: str) -> None:
    rig = Rig()
    reach(rig)
    state = rig.state
    clear = {"trajectory_armed": False, "policy_armed": False, "flying": False, "abort": False}
    assert rig.step(**{**clear, held: True}).mode == OutputMode.OFF
    assert rig.state is state
    assert rig.step(**clear).mode == OutputMode.PASS
    assert rig.state is LandingState.IDLE


@pytest.mark.parametrize("where", [Rig.brake, Rig.hold])
def test_only_a_hold_is_handed_back(where: Any) -> None:
    rig = Rig()
    where(rig)
    state = rig.state
    rig.step(trajectory_armed=False, position=(0.0, 0.0, 1.0), velocity=(0.0, 0.0, -0.1))
    assert rig.state is (LandingState.IDLE if state is LandingState.HOLD else LandingState.BRAKE)


def test_a_hold_is_watched_like_a_brake() -> None:
    rig = Rig()
    rig.hold()
    for _ in range(200):
        rig.step(gyro=(10.0, 0.0, 0.0))
    assert rig.state is LandingState.CUT


def test_a_trajectory_armed_during_a_latched_cut_must_be_armed_anew() -> None:
    rig = Rig()
    cut(rig)
    rig.step(trajectory_armed=False, policy_armed=False, flying=False, abort=False)
    assert rig.state is LandingState.IDLE
    rig.step(trajectory_armed=True, flying=True, position=(PLAN.x0, PLAN.y0, PLAN.z0), velocity=ZERO)
    assert rig.state is LandingState.TRAJECTORY_ARMED
