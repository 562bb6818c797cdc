"""Rehearsal mode in the app's shell, on a firmware made for tests."""

import shutil
from pathlib import Path

import pytest

from onboard.app_interface import LandingState, Log, Parameter, Rehearsal, TrajectoryStatus
from onboard.trajectory import plan_from_velocity
from tests.firmware.shell import Shell
from tests.firmware.test_shell import bundle, commit, fly, follow_the_approach

STILL = [0.0] * 4
PLAN = plan_from_velocity(1.25, 2.165, 0.0, 0.0, 2.1, 1.0, 3.1, 0.5)


@pytest.fixture
def shell(shell_library: Path, tmp_path: Path) -> Shell:
    """On the desk, disarmed, its app awake."""
    shell = Shell(Path(shutil.copy(shell_library, tmp_path)))
    fly(shell, 40)
    return shell


def asked(shell: Shell, kind: Rehearsal = Rehearsal.POSES) -> bool:
    """Whether the mode was taken."""
    shell.set(Parameter.REHEARSE, kind)
    return shell.read(Parameter.REHEARSE) == kind


def begin(shell: Shell, kind: Rehearsal = Rehearsal.POSES) -> None:
    """As :func:`tests.firmware.test_shell.arm`, of a drone that nobody armed: its setpoint is null."""
    commit(shell, bundle())
    assert asked(shell, kind)
    for name, value in (
        (Parameter.CEILING_Z, 2.1), (Parameter.SPEED_X, 1.25), (Parameter.SPEED_Z, 2.165),
        (Parameter.ACCELERATION_X, 1.0), (Parameter.ACCELERATION_Z, 3.1), (Parameter.TAU_START, 0.5),
    ):  # fmt: skip
        shell.set(name, value)
    if kind is Rehearsal.POSES:
        shell.state.position.x, shell.state.position.z = PLAN.x0, PLAN.z0
    fly(shell, 100)
    shell.set(Parameter.TRAJECTORY_ARM, 1)
    assert shell.read(Parameter.TRAJECTORY_STATUS) == TrajectoryStatus.ARMED
    shell.set(Parameter.POLICY_ARM, 1)
    shell.set(Parameter.GO, 1)
    fly(shell, 2)


@pytest.mark.parametrize("own_law", [0, 1])
def test_an_approach_is_computed_to_its_flip_and_nothing_comes_out(shell: Shell, own_law: int) -> None:
    shell.set(Parameter.OWN_LAW, own_law)
    begin(shell)
    pid_steps = shell.asked.pid_steps
    seen: set[LandingState] = set()

    def flips() -> bool:
        assert list(shell.control.forces) == STILL
        seen.add(LandingState(int(shell.log(Log.STATE))))
        return LandingState.FLIP in seen

    follow_the_approach(shell, flips)
    assert seen == {LandingState.APPROACH, LandingState.FLIP}
    fly(shell, 600)
    assert shell.log(Log.STATE) == LandingState.CUT, "a flip in which nothing turns takes too long"
    assert list(shell.control.forces) == STILL
    assert shell.asked.pid_steps == pid_steps
    assert (shell.asked.planner_stops, shell.asked.planner_goals) == (0, 0), "the planner is left alone"


def test_on_its_own_model_the_approach_is_flown_to_the_cut_and_nothing_comes_out(shell: Shell) -> None:
    """The firmware's estimate stays where the desk is, and no pose comes."""
    begin(shell, Rehearsal.MODEL)
    seen, highest = [LandingState.APPROACH], 0.0
    for _ in range(2500):
        shell.step()
        assert list(shell.control.forces) == STILL
        assert list(shell.outputs.thrusts) == STILL
        highest = max(highest, shell.log(Log.MODEL_Z))
        state = LandingState(int(shell.log(Log.STATE)))
        seen += [state] if state is not seen[-1] else []
    assert seen == [LandingState.APPROACH, LandingState.FLIP, LandingState.CUT]
    assert PLAN.z0 + 0.5 < highest
    assert (shell.state.position.x, shell.state.position.z) == (0.0, 0.0)
    assert (shell.asked.planner_stops, shell.asked.planner_goals, shell.asked.pid_steps) == (0, 0, 40)


def test_whoever_arms_is_disarmed_at_once(shell: Shell) -> None:
    assert asked(shell)
    shell.world.armed = True
    shell.step()
    assert not shell.world.armed
    assert shell.read(Parameter.REHEARSE) == 1


def test_whoever_arms_with_another_controller_is_disarmed_by_the_slow_task(shell: Shell) -> None:
    assert asked(shell)
    shell.world.armed = True
    shell.step_another_controller(21)
    assert not shell.world.armed


def test_a_drone_that_flies_with_another_controller_is_left_alone(shell: Shell) -> None:
    assert asked(shell)
    shell.world.armed = shell.world.flying = True
    shell.step_another_controller(100)
    assert shell.world.armed


@pytest.mark.parametrize(
    ("field", "value"),
    [("armed", True), ("flying", True), ("motor_override", 1), ("idle_thrust", 7000), ("estimator", 1)],
)
def test_it_is_not_taken_unless_all_is_still(shell: Shell, field: str, value: int) -> None:
    setattr(shell.world, field, value)
    if field not in ("armed", "flying"):
        shell.step(40)  # the app looks at the configuration every 20 ms
    assert not asked(shell)


@pytest.mark.parametrize("motor", range(4))
def test_it_is_not_taken_while_a_motor_has_a_thrust_and_ends_with_one(shell: Shell, motor: int) -> None:
    shell.world.motors[motor] = 1
    assert not asked(shell)
    shell.world.motors[motor] = 0
    begin(shell)
    shell.world.motors[motor] = 1
    shell.step()
    switches = (Parameter.REHEARSE, Parameter.TRAJECTORY_ARM, Parameter.POLICY_ARM, Parameter.GO)
    assert [shell.read(name) for name in switches] == [0] * 4
    assert shell.log(Log.STATE) == LandingState.IDLE


def test_a_write_in_flight_takes_no_thrust_away(shell: Shell) -> None:
    shell.set(Parameter.OWN_LAW, 1)
    shell.world.flying = shell.world.armed = True
    for mode in ("mode_x", "mode_y", "mode_z", "mode_yaw"):
        setattr(shell.setpoint, mode, 1)
    fly(shell, 40)
    assert shell.write(Parameter.REHEARSE, 1)
    for _ in range(20):
        fly(shell, 1)
        assert min(shell.control.forces) > 0.0
    assert shell.read(Parameter.REHEARSE) == 0


def test_after_it_the_drone_arms_and_the_firmware_flies_as_before(shell: Shell) -> None:
    begin(shell)
    follow_the_approach(shell, lambda: shell.state.velocity.z > 0.5)
    shell.set(Parameter.REHEARSE, 0)
    fly(shell, 2)
    assert shell.log(Log.STATE) == LandingState.IDLE
    shell.world.armed = True
    pid_steps = shell.asked.pid_steps
    fly(shell, 40)
    assert shell.world.armed
    assert shell.asked.pid_steps == pid_steps + 40
