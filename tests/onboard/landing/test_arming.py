"""Arming the trajectory, and go."""

from typing import Any

import pytest

from onboard.app_interface import TrajectoryStatus
from onboard.landing.state_machine import (
    LandingState,
    OutputMode,
)
from onboard.trajectory import (
    ApproachPlan,
    smooth_approach,
)
from tests.onboard.landing.rig import LIMITS, NAN, PLAN, Rig


def test_starts_idle_and_leaves_the_drone_to_others() -> None:
    rig = Rig()
    assert rig.step().mode == OutputMode.PASS
    assert rig.state is LandingState.IDLE
    assert rig.status is TrajectoryStatus.NONE


def test_arming_near_the_start_is_accepted_and_reversible() -> None:
    rig = Rig()
    assert rig.step(trajectory_armed=True).mode == OutputMode.PASS
    assert (rig.state, rig.status) == (LandingState.TRAJECTORY_ARMED, TrajectoryStatus.ARMED)
    rig.step(trajectory_armed=False)
    assert (rig.state, rig.status) == (LandingState.IDLE, TrajectoryStatus.NONE)


@pytest.mark.parametrize(
    ("changes", "plan", "status"),
    [
        ({"flying": False}, PLAN, TrajectoryStatus.REFUSED_NOT_FLYING),
        ({"position": (PLAN.x0 - 0.26, 0.0, PLAN.z0)}, PLAN, TrajectoryStatus.REFUSED_TOO_FAR),
        ({"position": (NAN, 0.0, PLAN.z0)}, PLAN, TrajectoryStatus.REFUSED_TOO_FAR),
        ({}, PLAN._replace(vz=NAN), TrajectoryStatus.REFUSED_NUMBERS),
        ({}, PLAN._replace(vz=0.0), TrajectoryStatus.REFUSED_NUMBERS),
        ({}, PLAN._replace(tau0=0.0), TrajectoryStatus.REFUSED_NUMBERS),
        ({}, PLAN._replace(z0=0.1), TrajectoryStatus.REFUSED_NUMBERS),
    ],
)
def test_arming_is_refused_with_a_status_that_stays_readable(
    changes: dict[str, Any], plan: ApproachPlan, status: TrajectoryStatus
) -> None:
    rig = Rig()
    rig.plan = plan
    rig.step(trajectory_armed=True, **changes)
    assert (rig.state, rig.status) == (LandingState.IDLE, status)
    rig.plan = PLAN
    rig.step(position=(PLAN.x0, 0.0, PLAN.z0), flying=True)
    assert rig.state is LandingState.IDLE, "a refused request must be made again"
    rig.step(trajectory_armed=False)
    assert rig.status is status
    rig.step(trajectory_armed=True)
    assert rig.status is TrajectoryStatus.ARMED


def test_go_without_arming_does_nothing() -> None:
    rig = Rig()
    rig.step(go=True)
    assert rig.state is LandingState.IDLE
    rig.step(trajectory_armed=True)
    rig.step()
    assert rig.state is LandingState.TRAJECTORY_ARMED, "an old go must not start a newly armed approach"


@pytest.mark.parametrize(
    "changes",
    [
        {"position": (PLAN.x0 + 0.26, 0.0, PLAN.z0)},
        {"position": (PLAN.x0, 0.0, NAN)},
        {"velocity": (0.0, 0.31, 0.0)},
        {"velocity": (0.0, NAN, 0.0)},
        {"quaternion": (0.0, 0.0, 0.0, NAN)},
        {"pose_age": 0.2},
        {"pose_age": NAN},
    ],
)
def test_go_is_denied_away_from_the_start_or_without_a_pose(changes: dict[str, Any]) -> None:
    rig = Rig()
    rig.step(trajectory_armed=True)
    before = {key: getattr(rig.inputs, key) for key in changes}
    rig.step(go=True, **changes)
    assert rig.state is LandingState.TRAJECTORY_ARMED
    rig.step(**before)
    assert rig.state is LandingState.TRAJECTORY_ARMED, "a denied go must be given again"
    rig.step(go=False)
    rig.step(go=True)
    assert (rig.state, rig.status) == (LandingState.APPROACH, TrajectoryStatus.FLYING)


@pytest.mark.parametrize("elapsed", [0.0, 0.7, 2.1, 2.5])
def test_the_approach_is_the_plan(elapsed: float) -> None:
    rig = Rig()
    output = rig.approach(elapsed)
    assert output.mode == OutputMode.SETPOINT
    position, velocity, acceleration, jerk = smooth_approach(
        PLAN, elapsed - LIMITS.smoothing, LIMITS.smoothing
    )
    assert output.position == pytest.approx(position, abs=1e-9)
    assert output.velocity == pytest.approx(velocity, abs=1e-9)
    if jerk[2] == 0.0:
        assert output.acceleration == pytest.approx(acceleration, abs=1e-9)


def test_the_approach_begins_where_the_drone_hovers() -> None:
    output = Rig().approach(0.0)
    assert output.position == pytest.approx((PLAN.x0, PLAN.y0, PLAN.z0))
    assert output.velocity == pytest.approx((0.0, 0.0, 0.0))


def test_thrust_is_commanded_ahead_of_the_motors() -> None:
    climb_begins, climb_ends = PLAN.t_x + LIMITS.smoothing, PLAN.t_x + PLAN.t_z + LIMITS.smoothing
    assert Rig().approach(climb_begins).acceleration[2] > 0.5 * PLAN.az
    assert Rig().approach(climb_ends).acceleration[2] < 0.5 * PLAN.az
