"""The simulated drone's supervisor keeps the firmware's states and timings."""

import pytest

from onboard.supervisor_info import SupervisorBits, SupervisorInfo
from sim_backend.crazyflie.supervisor import Supervisor, SupervisorState

UPRIGHT = (0.0, 0.0, 1.0)
ON_ITS_SIDE = (1.0, 0.0, 0.0)
UPSIDE_DOWN = (0.0, 0.0, -1.0)
FALLING = (0.01, 0.0, 0.02)
STEP_MS = 40


class Drive:
    """Runs a supervisor at 25 Hz and keeps the setpoint fresh unless told otherwise."""

    def __init__(self) -> None:
        self.supervisor = Supervisor()
        self.tick = 0
        self.setpoint_ms = 0

    def run(
        self,
        duration_ms: int,
        acc: tuple[float, float, float] = UPRIGHT,
        motors: bool = False,
        setpoints: bool = True,
    ) -> None:
        for _ in range(duration_ms // STEP_MS):
            self.tick += STEP_MS
            if setpoints:
                self.setpoint_ms = self.tick
            self.supervisor.update(self.tick, acc, motors, self.setpoint_ms, SupervisorBits(0))

    def time_until(self, state: SupervisorState, limit_ms: int = 60000, **kwargs: object) -> int:
        start = self.tick
        while self.supervisor.state is not state:
            assert self.tick - start < limit_ms, f"never reached {state.name}"
            self.run(STEP_MS, **kwargs)  # type: ignore[arg-type] # forwarded unchanged
        return self.tick - start

    @property
    def info(self) -> SupervisorInfo:
        return SupervisorInfo(self.supervisor.info_bits())


@pytest.fixture
def flying() -> Drive:
    drive = Drive()
    drive.run(200)
    assert drive.supervisor.arm(True)
    drive.run(200)
    drive.run(200, motors=True)
    assert drive.supervisor.state is SupervisorState.FLYING
    return drive


def test_arming_needs_passed_checks_and_is_explicit() -> None:
    drive = Drive()
    assert not drive.supervisor.arm(True), "before the preflight checks"
    drive.run(1000)
    assert drive.supervisor.state is SupervisorState.PREFLIGHT_CHECKS_PASSED
    assert drive.info.can_arm
    assert not drive.info.auto_arm
    assert not drive.info.is_armed
    assert drive.supervisor.arm(True)
    drive.run(80)
    assert drive.supervisor.state is SupervisorState.READY_TO_FLY
    assert drive.info.can_fly
    assert not drive.info.can_arm


def test_tumbled_drone_cannot_arm() -> None:
    drive = Drive()
    drive.run(1000, acc=UPSIDE_DOWN)
    assert drive.supervisor.state is SupervisorState.PREFLIGHT_CHECKS_NOT_PASSED
    assert drive.info.is_tumbled
    assert not drive.supervisor.arm(True)


def test_ready_but_not_flying_disarms_after_30_s() -> None:
    drive = Drive()
    drive.run(200)
    drive.supervisor.arm(True)
    drive.run(80)
    waited = drive.time_until(SupervisorState.PREFLIGHT_CHECKS_NOT_PASSED)
    assert 30000 <= waited <= 30080
    assert not drive.info.is_armed


def test_setpoints_that_stop_level_out_at_500_ms_and_lock_at_2000_ms(flying: Drive) -> None:
    level_out = flying.time_until(SupervisorState.WARNING_LEVEL_OUT, motors=True, setpoints=False)
    assert 500 < level_out <= 560
    assert flying.supervisor.motors_allowed
    falling = flying.time_until(SupervisorState.EXCEPTION_FREE_FALL, motors=True, setpoints=False)
    assert 2000 < level_out + falling <= 2060
    assert not flying.supervisor.motors_allowed
    flying.run(STEP_MS)
    assert flying.supervisor.state is SupervisorState.LOCKED
    flying.run(10000)
    assert flying.info.is_locked
    assert not flying.supervisor.arm(True)


def test_setpoints_that_return_end_the_level_out(flying: Drive) -> None:
    flying.run(1000, motors=True, setpoints=False)
    assert flying.supervisor.state is SupervisorState.WARNING_LEVEL_OUT
    flying.run(STEP_MS, motors=True)
    assert flying.supervisor.state is SupervisorState.FLYING


def test_upside_down_in_flight_crashes_after_100_ms_and_recovers_upright(flying: Drive) -> None:
    crash = flying.time_until(SupervisorState.CRASHED, acc=UPSIDE_DOWN, motors=True)
    assert 100 < crash <= 200
    assert flying.info.is_crashed
    assert not flying.supervisor.recover(), "still upside down"
    flying.run(200)
    assert flying.supervisor.recover()
    flying.run(120)
    assert flying.supervisor.state is SupervisorState.PREFLIGHT_CHECKS_PASSED


def test_tilt_is_allowed_for_one_second_only(flying: Drive) -> None:
    crash = flying.time_until(SupervisorState.CRASHED, acc=ON_ITS_SIDE, motors=True)
    assert 1000 < crash <= 1100


def test_free_fall_is_not_a_tumble(flying: Drive) -> None:
    flying.run(5000, acc=FALLING, motors=True)
    assert flying.supervisor.state is SupervisorState.FLYING


def test_tumble_in_level_out_locks(flying: Drive) -> None:
    flying.run(600, motors=True, setpoints=False)
    flying.time_until(SupervisorState.LOCKED, acc=UPSIDE_DOWN, motors=True, setpoints=False, limit_ms=300)


def test_tumble_check_can_be_disabled(flying: Drive) -> None:
    flying.supervisor.tumble_check_enabled = False
    flying.run(5000, acc=UPSIDE_DOWN, motors=True)
    assert flying.supervisor.state is SupervisorState.FLYING
    assert not flying.info.is_tumbled


def test_landed_after_two_quiet_seconds_and_disarmed_three_later(flying: Drive) -> None:
    landed = flying.time_until(SupervisorState.LANDED)
    assert 1920 <= landed <= 2040
    reset = flying.time_until(SupervisorState.RESET)
    assert 3000 < reset <= 3080
    assert not flying.info.is_armed


def test_disarming_in_flight_stops_the_motors(flying: Drive) -> None:
    flying.supervisor.arm(False)
    flying.run(STEP_MS, motors=True)
    assert not flying.supervisor.motors_allowed


@pytest.mark.parametrize("way", ["command", "parameter"])
def test_emergency_stop_is_latched(flying: Drive, way: str) -> None:
    if way == "command":
        flying.supervisor.emergency_stop()
    else:
        flying.supervisor.stop_parameter = True
    flying.run(2 * STEP_MS, motors=True)
    assert flying.info.is_locked


def test_emergency_stop_on_the_ground_locks_too() -> None:
    drive = Drive()
    drive.run(200)
    drive.supervisor.emergency_stop()
    drive.run(120)
    assert drive.info.is_locked


def test_watchdog_stops_one_second_after_the_last_kick(flying: Drive) -> None:
    for _ in range(20):
        flying.supervisor.kick_emergency_stop_watchdog()
        flying.run(480, motors=True)
    assert flying.supervisor.state is SupervisorState.FLYING
    flying.supervisor.kick_emergency_stop_watchdog()
    assert 1000 <= flying.time_until(SupervisorState.EXCEPTION_FREE_FALL, motors=True) <= 1080


def test_without_a_first_kick_the_watchdog_sleeps(flying: Drive) -> None:
    flying.run(20000, motors=True)
    assert flying.supervisor.state is SupervisorState.FLYING


def test_crash_detection_by_acceleration_norm(flying: Drive) -> None:
    flying.supervisor.tumble.crash_detection_g = 3.0
    flying.run(400, acc=(0.0, 0.0, 3.5), motors=True)
    assert flying.supervisor.state is SupervisorState.FLYING
    flying.run(STEP_MS, acc=(0.0, 0.0, 4.5), motors=True)
    assert flying.supervisor.state is SupervisorState.CRASHED
