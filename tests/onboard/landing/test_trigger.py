"""The trigger, and all that denies it."""

import math
from typing import Any

import pytest

from onboard.landing.state_machine import (
    EndReason,
    LandingState,
    OutputMode,
)
from onboard.rotation import from_rotation_vector
from tests.onboard.landing.rig import LIMITS, NAN, PLAN, Rig


def test_trigger_flips_with_the_front_motors_and_keeps_the_snapshot() -> None:
    rig = Rig()
    output = rig.flip()
    assert rig.reason is EndReason.TRIGGERED
    assert output.mode == OutputMode.THRUSTS
    front = 7e-3 / (2 * 0.0325)
    assert output.thrusts == pytest.approx((front, 0.0, 0.0, front))
    snapshot, inputs = rig.memory, rig.inputs
    assert snapshot["snapshot_count"] == 1
    assert snapshot["snapshot_time"] == inputs.time
    for name in ("tau", "theta_x", "d_ceil", "trigger_value", "a_rot"):
        assert snapshot[f"snapshot_{name}"] == pytest.approx(getattr(inputs, name))
    assert tuple(snapshot["snapshot_velocity"]) == pytest.approx(inputs.velocity)
    assert snapshot["snapshot_z"] == pytest.approx(inputs.position[2])
    # Later samples do not change it.
    rig.step(trigger_value=0.5, a_rot=-1e-3)
    assert snapshot["snapshot_a_rot"] == pytest.approx(-7e-3)


def test_flip_thrust_is_bounded_by_the_motors() -> None:
    rig = Rig()
    rig.approach(PLAN.impact_time - 0.251, policy_armed=True)
    output = rig.step(**{**rig.trigger_sample(), "a_rot": -1.0})
    assert output.thrusts == pytest.approx((LIMITS.thrust_max, 0.0, 0.0, LIMITS.thrust_max))


@pytest.mark.parametrize(
    "denial",
    [
        {"policy_armed": False},
        {"evaluated": False},
        {"trigger_value": -1e-6},
        {"trigger_value": math.inf},
        {"trigger_value": NAN},
        {"tau": NAN},
        {"tau": math.inf},
        {"tau": 0.0},
        {"theta_x": NAN},
        {"theta_x": math.inf},
        {"d_ceil": NAN},
        {"d_ceil": -0.1},
        {"a_rot": NAN},
        {"a_rot": math.inf},
        {"a_rot": 0.0},
        {"velocity": (1.9, 0.0, -0.1)},
        {"velocity": (NAN, 0.0, 1.6)},
        {"velocity": (1.9, NAN, 1.6)},
        {"velocity": (1.9, 0.0, NAN)},
        {"position": (NAN, 0.0, 1.5)},
        {"position": (0.0, NAN, 1.5)},
        {"position": (0.0, 0.0, NAN)},
        {"quaternion": (NAN, 0.0, 0.0, 1.0)},
        {"gyro": (0.0, NAN, 0.0)},
        {"pose_age": NAN},
        {"pose_age": 0.2},
        {"trajectory_armed": False},
        {"abort": True},
        {"flying": False},
    ],
)
def test_default_deny(denial: dict[str, Any]) -> None:
    rig = Rig()
    rig.approach(PLAN.impact_time - 0.251, policy_armed=True)
    rig.step(**{**rig.trigger_sample(), **denial})
    assert rig.state is not LandingState.FLIP
    assert rig.memory["snapshot_count"] == 0


@pytest.mark.parametrize("state", [s for s in LandingState if s is not LandingState.APPROACH])
def test_only_the_approach_can_trigger(state: LandingState) -> None:
    rig = Rig()
    rig.step()
    rig.memory["state"] = int(state)
    rig.step(trajectory_armed=True, **rig.trigger_sample())
    assert rig.memory["snapshot_count"] == 0
    if state is not LandingState.FLIP:
        assert rig.state is not LandingState.FLIP


def test_a_tilted_vehicle_does_not_flip() -> None:
    rig = Rig()
    rig.step(quaternion=from_rotation_vector((1.1, 0.0, 0.0)))
    rig.approach(PLAN.impact_time - 0.251, policy_armed=True)
    rig.step(**rig.trigger_sample())
    assert rig.state is LandingState.APPROACH
    assert rig.memory["snapshot_count"] == 0
