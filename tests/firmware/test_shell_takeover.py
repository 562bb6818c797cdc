"""Somebody takes over in flight: another controller, the firmware's PID, a configuration that is none."""

from pathlib import Path

import pytest

from onboard.app_interface import LandingState, Log, Parameter
from tests.firmware.shell import Shell
from tests.firmware.test_shell import CONTROL_MODE_FORCE, arm, boot, fly, follow_the_approach, hover

ENDED = (LandingState.BRAKE, LandingState.HOLD)
PITCHED = 0.2588
"""sin of 15 deg: half of what the nose is down."""


@pytest.fixture
def shell(shell_library: Path) -> Shell:
    return boot(shell_library)


def climb(shell: Shell, speed: float) -> None:
    """On the approach, as fast as that."""
    arm(shell)
    follow_the_approach(shell, lambda: shell.state.velocity.z > speed)
    assert shell.log(Log.STATE) == LandingState.APPROACH


def test_an_approach_does_not_outlive_another_controller(shell: Shell) -> None:
    """The firmware initialises a controller whenever it is chosen, in flight as well."""
    climb(shell, 0.5)
    shell.leave_to_another_controller(8)
    fly(shell, 4)
    assert shell.log(Log.STATE) in ENDED


def test_an_approach_does_not_outlive_a_loop_that_stood_still(shell: Shell) -> None:
    """In a health test the firmware sets the motors itself, and does not count the steps."""
    climb(shell, 0.5)
    shell.world.tick_ms += 8
    fly(shell, 4)
    assert shell.log(Log.STATE) in ENDED


def test_a_step_that_comes_late_is_no_gap(shell: Shell) -> None:
    climb(shell, 0.5)
    shell.world.tick_ms += 4
    fly(shell, 4)
    assert shell.log(Log.STATE) == LandingState.APPROACH


def test_after_a_gap_the_attitude_is_the_estimates(shell: Shell) -> None:
    """The drone has turned while nobody followed the gyro; the brake levels the attitude that it has now."""
    climb(shell, 2.1)
    shell.state.quaternion.y, shell.state.quaternion.w = PITCHED, (1.0 - PITCHED**2) ** 0.5
    shell.leave_to_another_controller(500)
    fly(shell, 4)
    assert shell.log(Log.STATE) == LandingState.BRAKE
    front_right, back_right, back_left, front_left = shell.outputs.thrusts
    assert front_right + front_left > back_right + back_left + 0.05


def test_our_law_begins_without_the_errors_of_the_firmwares(shell_library: Path) -> None:
    """A PID that has held the drone 0.1 m too low for seconds, and one that has just begun."""
    collectives = []
    for seconds in (0, 10):
        shell = boot(shell_library)
        hover(shell)
        shell.setpoint.position.z += 0.1
        fly(shell, 1000 * seconds)
        shell.set(Parameter.OWN_LAW, 1)
        fly(shell, 2)
        assert shell.control.mode == CONTROL_MODE_FORCE
        collectives.append(sum(shell.outputs.thrusts))
    assert collectives[1] == pytest.approx(collectives[0], abs=1e-3)


@pytest.mark.parametrize("own_law", [0, 1])
def test_a_configuration_that_is_changed_in_flight_ends_an_approach_and_drops_nobody(
    shell: Shell, own_law: int
) -> None:
    shell.set(Parameter.OWN_LAW, own_law)
    climb(shell, 0.5)
    shell.world.idle_thrust = 7000
    fly(shell, 24)
    assert shell.log(Log.STATE) in ENDED
    shell.state.velocity = type(shell.state.velocity)()
    fly(shell, 300)
    assert shell.log(Log.STATE) == LandingState.HOLD
    assert shell.control.mode == CONTROL_MODE_FORCE
    assert sum(shell.control.forces) > 1.2  # it carries its weight
