"""The simulated drone's supervisor: preflight checks, arming, flying, tumble check, watchdogs, locks (25 Hz).

A pure state machine: it knows ticks (ms), the accelerometer (g), whether a motor turns and the age of the
setpoint, and answers in info bits and in whether motors may turn. States, rules, their order and every
constant are those of bitcraze/crazyflie-firmware 2026.08 (``supervisor.c``, ``supervisor_state_machine.c``,
``platform_defaults.h``); the conditions that need rpm feedback or a supervised deck are left out, because a
brushed Crazyflie 2.1 has neither. The build modelled: ``CONFIG_MOTORS_REQUIRE_ARMING=y``, idle thrust 0.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum, IntEnum, IntFlag, auto

from onboard.supervisor_info import SupervisorBits

RATE_HZ = 25
COMMANDER_WARNING_MS = 500
COMMANDER_TIMEOUT_MS = 2000
FLYING_HYSTERESIS_MS = 2000
EMERGENCY_STOP_WATCHDOG_MS = 1000
TILTED_ACC_Z_G = 0.5
TILTED_TIME_MS = 1000
UPSIDE_DOWN_ACC_Z_G = -0.2
UPSIDE_DOWN_TIME_MS = 100
FREE_FALL_G = 0.1


class SupervisorState(IntEnum):
    """States, numbered as in the firmware."""

    NOT_INITIALIZED = 0
    PREFLIGHT_CHECKS_NOT_PASSED = 1
    PREFLIGHT_CHECKS_PASSED = 2
    ARMING = 3
    READY_TO_FLY = 4
    FLYING = 5
    LANDED = 6
    RESET = 7
    WARNING_LEVEL_OUT = 8
    EXCEPTION_FREE_FALL = 9
    LOCKED = 10
    CRASHED = 11


class SupervisorCondition(IntFlag):
    """What the rules look at."""

    NONE = 0
    ARMED = auto()
    FLYING = auto()
    TUMBLED = auto()
    COMMANDER_WARNING = auto()
    COMMANDER_TIMEOUT = auto()
    EMERGENCY_STOP = auto()
    CRASHED = auto()
    PREFLIGHT_TIMEOUT = auto()
    LANDING_TIMEOUT = auto()
    SPINUP_TIMEOUT = auto()


class When(Enum):
    """How the conditions of a rule combine."""

    ANY = auto()
    ALL = auto()
    ALWAYS = auto()


@dataclass(frozen=True, slots=True)
class Transition:
    """Go to `to` when the conditions `present` hold and `missing` do not; never while `blocked` holds."""

    to: SupervisorState
    when: When
    present: SupervisorCondition = SupervisorCondition.NONE
    missing: SupervisorCondition = SupervisorCondition.NONE
    blocked: SupervisorCondition = SupervisorCondition.NONE

    def fires(self, conditions: SupervisorCondition) -> bool:
        """Whether this rule moves the state under `conditions`."""
        if conditions & self.blocked:
            return False
        if self.when is When.ALWAYS:
            return True
        absent = ~conditions
        if self.when is When.ANY:
            return bool(conditions & self.present) or bool(absent & self.missing)
        return not (absent & self.present) and not (conditions & self.missing)


_C, _S = SupervisorCondition, SupervisorState
_E_STOP = Transition(_S.EXCEPTION_FREE_FALL, When.ANY, present=_C.EMERGENCY_STOP)

RULES: dict[SupervisorState, tuple[Transition, ...]] = {
    _S.NOT_INITIALIZED: (Transition(_S.PREFLIGHT_CHECKS_NOT_PASSED, When.ALWAYS),),
    _S.PREFLIGHT_CHECKS_NOT_PASSED: (
        _E_STOP,
        Transition(_S.PREFLIGHT_CHECKS_PASSED, When.ALWAYS, blocked=_C.TUMBLED),
    ),
    _S.PREFLIGHT_CHECKS_PASSED: (
        _E_STOP,
        Transition(_S.PREFLIGHT_CHECKS_NOT_PASSED, When.ANY, present=_C.TUMBLED),
        Transition(_S.ARMING, When.ALL, present=_C.ARMED, blocked=_C.TUMBLED),
    ),
    _S.ARMING: (
        _E_STOP,
        Transition(
            _S.PREFLIGHT_CHECKS_NOT_PASSED,
            When.ANY,
            present=_C.TUMBLED | _C.SPINUP_TIMEOUT,
            missing=_C.ARMED,
        ),
        # Without rpm feedback the spin-up counts as done at once.
        Transition(_S.READY_TO_FLY, When.ALWAYS),
    ),
    _S.READY_TO_FLY: (
        _E_STOP,
        Transition(
            _S.PREFLIGHT_CHECKS_NOT_PASSED,
            When.ANY,
            present=_C.TUMBLED | _C.PREFLIGHT_TIMEOUT,
            missing=_C.ARMED,
        ),
        Transition(_S.FLYING, When.ALL, present=_C.FLYING),
    ),
    _S.FLYING: (
        Transition(_S.EXCEPTION_FREE_FALL, When.ANY, present=_C.COMMANDER_TIMEOUT | _C.EMERGENCY_STOP),
        Transition(_S.CRASHED, When.ANY, present=_C.TUMBLED),
        Transition(_S.RESET, When.ALL, missing=_C.ARMED),
        Transition(_S.WARNING_LEVEL_OUT, When.ALL, present=_C.COMMANDER_WARNING),
        Transition(_S.LANDED, When.ALL, missing=_C.FLYING),
    ),
    _S.LANDED: (
        Transition(_S.RESET, When.ANY, present=_C.LANDING_TIMEOUT, missing=_C.ARMED),
        Transition(_S.FLYING, When.ALL, present=_C.FLYING),
    ),
    _S.RESET: (Transition(_S.PREFLIGHT_CHECKS_NOT_PASSED, When.ALWAYS),),
    _S.WARNING_LEVEL_OUT: (
        Transition(
            _S.EXCEPTION_FREE_FALL,
            When.ANY,
            present=_C.COMMANDER_TIMEOUT | _C.TUMBLED | _C.EMERGENCY_STOP,
        ),
        Transition(_S.FLYING, When.ALL, missing=_C.COMMANDER_WARNING | _C.COMMANDER_TIMEOUT),
    ),
    _S.EXCEPTION_FREE_FALL: (Transition(_S.LOCKED, When.ALWAYS),),
    _S.LOCKED: (),
    _S.CRASHED: (
        Transition(_S.PREFLIGHT_CHECKS_NOT_PASSED, When.ALL, missing=_C.CRASHED | _C.TUMBLED),
        Transition(_S.LOCKED, When.ALL, present=_C.EMERGENCY_STOP),
    ),
}

_CAN_FLY = frozenset(
    {
        SupervisorState.READY_TO_FLY,
        SupervisorState.FLYING,
        SupervisorState.WARNING_LEVEL_OUT,
        SupervisorState.LANDED,
    }
)
_ARMED_STATES = _CAN_FLY | {SupervisorState.ARMING}


class TumbleCheck:
    """Tilted for long, or upside down for a short time; falling freely is allowed."""

    def __init__(self) -> None:
        self.crash_detection_g = 0.0
        self.acc_norm_g = 0.0
        self._since_ms: int | None = None

    def tumbled(self, tick_ms: int, acc_g: tuple[float, float, float]) -> bool:
        """Whether the accelerometer (g, body axes) says that the drone lies on its side or upside down."""
        x, y, z = acc_g
        self.acc_norm_g = math.sqrt(x * x + y * y + z * z)
        if self.crash_detection_g > 0.0 and abs(self.acc_norm_g - 1.0) > self.crash_detection_g:
            return True
        if abs(x) < FREE_FALL_G and abs(y) < FREE_FALL_G and abs(z) < FREE_FALL_G:
            self._since_ms = None
        if z >= TILTED_ACC_Z_G:
            self._since_ms = None
            return False
        if self._since_ms is None:
            self._since_ms = tick_ms
        elapsed = tick_ms - self._since_ms
        return elapsed > TILTED_TIME_MS or (z < UPSIDE_DOWN_ACC_Z_G and elapsed > UPSIDE_DOWN_TIME_MS)


class Supervisor:
    """State machine, latches and timers of one drone; everything is lost at a reboot (make a new one).

    Args:
        auto_arm: arm when the preflight checks have passed, without being asked.
        may_arm: whether the app lets anybody arm.
    """

    def __init__(self, auto_arm: bool = False, may_arm: Callable[[], bool] = lambda: True) -> None:
        self._auto_arm = auto_arm
        self._may_arm = may_arm
        self.state = SupervisorState.NOT_INITIALIZED
        self.tumble = TumbleCheck()
        self.tumble_check_enabled = True
        self.preflight_timeout_ms = 30000
        self.landed_timeout_ms = 3000
        self.spinup_timeout_ms = 2000
        self.stop_parameter = False
        self._armed = False
        self._tumbled = False
        self._crashed = False
        self._emergency_stop = False
        self._watchdog_kick_ms: int | None = None
        self._thrust_ms: int | None = None
        self._entered_ms = 0
        self._tick_ms = 0
        self._info = SupervisorBits(0)
        self._console: list[str] = []

    # What port 9 asks for.

    def info_bits(self) -> int:
        """The bit field of ``supervisor.info``; see :class:`onboard.supervisor_info.SupervisorBits`.

        As in the firmware (``updateLogData``), it is written at the end of each update: a request of the
        client shows in it up to 40 ms later.
        """
        return int(self._info)

    def arm(self, on: bool) -> bool:
        """Arm or disarm; whether the request was accepted. Arming needs passed preflight checks."""
        if on == self._armed:
            return True
        if on and not (self.state is SupervisorState.PREFLIGHT_CHECKS_PASSED and self._may_arm()):
            return False
        self._armed = on
        return True

    def recover(self) -> bool:
        """Clear a crash; refused while the drone lies tumbled."""
        if self._crashed and self._tumbled:
            return False
        self._crashed = False
        return True

    def emergency_stop(self) -> None:
        """Stop the motors until a reboot."""
        self._emergency_stop = True

    def kick_emergency_stop_watchdog(self) -> None:
        """Start or feed the watchdog: 1 s without a kick is an emergency stop. It cannot be cancelled."""
        self._watchdog_kick_ms = self._tick_ms

    @property
    def watchdog_runs(self) -> bool:
        """Whether the emergency-stop watchdog was kicked and has not bitten yet."""
        return self._watchdog_kick_ms is not None and self.state is not SupervisorState.LOCKED

    # What the stabilizer loop asks for.

    @property
    def is_armed(self) -> bool:
        """Whether an arming request is in force."""
        return self._armed

    @property
    def can_fly(self) -> bool:
        """Whether setpoints are obeyed and the high-level commander is not blocked."""
        return self.state in _CAN_FLY

    @property
    def is_flying(self) -> bool:
        """Flying, or levelling out on a missing setpoint."""
        return self.state in (SupervisorState.FLYING, SupervisorState.WARNING_LEVEL_OUT)

    @property
    def is_tumbled(self) -> bool:
        """Whether the tumble check (if enabled) holds."""
        return self._tumbled

    @property
    def is_crashed(self) -> bool:
        """Whether a crash waits for the recovery command."""
        return self._crashed

    @property
    def motors_allowed(self) -> bool:
        """Whether the motor drivers are enabled."""
        return self.state in _ARMED_STATES

    def take_console(self) -> list[str]:
        """Lines for the console since the last call."""
        lines, self._console = self._console, []
        return lines

    def update(
        self,
        tick_ms: int,
        acc_g: tuple[float, float, float],
        motors_turning: bool,
        setpoint_time_ms: int,
        high_level: SupervisorBits,
    ) -> None:
        """Advance by one 25 Hz step.

        Args:
            tick_ms: ms since boot.
            acc_g: accelerometer, body axes, g.
            motors_turning: whether any motor's ratio is above the idle thrust.
            setpoint_time_ms: tick of the setpoint in force.
            high_level: bits 8 to 10, as the high-level commander reports them.
        """
        self._tick_ms = tick_ms
        if motors_turning:
            self._thrust_ms = tick_ms
        conditions = self._conditions(tick_ms, acc_g, tick_ms - setpoint_time_ms)
        for rule in RULES[self.state]:
            if rule.fires(conditions):
                self._enter(rule.to, tick_ms)
                break
        self._tumbled = bool(conditions & SupervisorCondition.TUMBLED)
        if self._auto_arm and self._may_arm() and self.state is SupervisorState.PREFLIGHT_CHECKS_PASSED:
            self._armed = True
        self._info = high_level | self._state_bits()

    def _state_bits(self) -> SupervisorBits:
        """Bits 0 to 7, as they are now."""
        bits = SupervisorBits(0)
        if self.state is SupervisorState.PREFLIGHT_CHECKS_PASSED:
            bits |= SupervisorBits.CAN_ARM
        if self._armed:
            bits |= SupervisorBits.ARMED
        if self._auto_arm:
            bits |= SupervisorBits.AUTO_ARM
        if self.can_fly:
            bits |= SupervisorBits.CAN_FLY
        if self.is_flying:
            bits |= SupervisorBits.FLYING
        if self._tumbled:
            bits |= SupervisorBits.TUMBLED
        if self.state is SupervisorState.LOCKED:
            bits |= SupervisorBits.LOCKED
        if self._crashed:
            bits |= SupervisorBits.CRASHED
        return bits

    def watch(self, tick_ms: int) -> None:
        """Tell the time between updates (a watchdog kick is stamped with it)."""
        self._tick_ms = tick_ms

    def _conditions(
        self, tick_ms: int, acc_g: tuple[float, float, float], setpoint_age_ms: int
    ) -> SupervisorCondition:
        in_state_ms = tick_ms - self._entered_ms
        found = SupervisorCondition.NONE
        if self._armed:
            found |= SupervisorCondition.ARMED
        if self._thrust_ms is not None and tick_ms - self._thrust_ms < FLYING_HYSTERESIS_MS:
            found |= SupervisorCondition.FLYING
        if self.tumble.tumbled(tick_ms, acc_g) and self.tumble_check_enabled:
            found |= SupervisorCondition.TUMBLED
        if setpoint_age_ms > COMMANDER_WARNING_MS:
            found |= SupervisorCondition.COMMANDER_WARNING
        if setpoint_age_ms > COMMANDER_TIMEOUT_MS:
            found |= SupervisorCondition.COMMANDER_TIMEOUT
        kick = self._watchdog_kick_ms
        watchdog_expired = kick is not None and tick_ms >= kick + EMERGENCY_STOP_WATCHDOG_MS
        if self._emergency_stop or self.stop_parameter or watchdog_expired:
            found |= SupervisorCondition.EMERGENCY_STOP
        if self._crashed:
            found |= SupervisorCondition.CRASHED
        if self.state is SupervisorState.READY_TO_FLY and in_state_ms > self.preflight_timeout_ms:
            found |= SupervisorCondition.PREFLIGHT_TIMEOUT
        if self.state is SupervisorState.LANDED and in_state_ms > self.landed_timeout_ms:
            found |= SupervisorCondition.LANDING_TIMEOUT
        if self.state is SupervisorState.ARMING and in_state_ms > self.spinup_timeout_ms:
            found |= SupervisorCondition.SPINUP_TIMEOUT
        return found

    def _enter(self, state: SupervisorState, tick_ms: int) -> None:
        was_armed = self._armed
        self.state = state
        self._entered_ms = tick_ms
        if state is SupervisorState.READY_TO_FLY:
            self._say("Ready to fly")
        elif state is SupervisorState.EXCEPTION_FREE_FALL:
            self._say("free falling!")
        elif state is SupervisorState.LOCKED:
            self._say("Locked, reboot required")
        elif state is SupervisorState.CRASHED:
            self._say("Crashed, recovery required")
            self._crashed = True
        if state not in _ARMED_STATES:
            self._armed = False
            if was_armed and state in (SupervisorState.RESET, SupervisorState.PREFLIGHT_CHECKS_NOT_PASSED):
                self._say("Disarming")

    def _say(self, text: str) -> None:
        self._console.append(f"SUP: {text}\n")
