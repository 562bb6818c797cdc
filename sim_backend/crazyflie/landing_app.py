"""Our firmware app in the simulated drone: the landing machine behind :mod:`onboard.app_interface`.

The landing machine runs at the controller's 500 Hz, the policy at 100 Hz on the estimated state. Where the
app flies, it takes the place of the controller (on the real drone it is an out-of-tree controller); the
supervisor's motor gate stays in force, and a null or levelled-out setpoint aborts an approach. When the app
hands back after a brake, the high-level commander is told to stay where the drone is; when it cuts, the
commander's plan is dropped.

Two tasks meet here, as on the real drone: the parameter task posts (a request with a snapshot of the plan,
flags), the control loop takes what is posted at its next step and answers through the parameters.
"""

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING

from onboard.app_interface import REQUEST_TIMEOUT_MS, LandingState, Log, Parameter, TrajectoryStatus
from onboard.controller import attitude_control
from onboard.cues import optical_flow_cues
from onboard.landing.state_machine import (
    LandingInputs,
    LandingOutput,
    OutputMode,
    landing_limits,
    landing_step,
    new_landing_memory,
)
from onboard.policy.action import action_moment
from onboard.policy.trigger import trigger_value
from onboard.trajectory import ApproachPlan, plan_from_velocity
from onboard.vehicle import Vehicle
from onboard.vehicle.onboard_constants import vehicle_crc32
from sim_backend.crazyflie.policy_slot import PolicySlot
from sim_backend.crazyflie.setpoint import Mode, Setpoint
from sim_backend.crazyflie.stabilizer import ATTITUDE_PERIOD_MS, Stabilizer
from sim_backend.crazyflie.supervisor import State
from sim_backend.crazyflie.tables import Number, ParameterTable

if TYPE_CHECKING:
    from sim_backend.crazyflie.firmware import Firmware

POLICY_PERIOD_MS = 10
_NO_PLAN = ApproachPlan(*[math.nan] * 12)
_CUT = (LandingState.CUT, LandingState.FAULT)


@dataclass(frozen=True, slots=True)
class _Request:
    """What a write of ``perch.trjArm`` asks of the control loop."""

    number: int
    armed: bool
    plan: ApproachPlan


class LandingApp:
    """The app of one drone.

    Attributes:
        slot: staged and live policy.
        memory: the landing machine's record (:data:`onboard.landing.model.LANDING_MEMORY`).
    """

    def __init__(self, vehicle: Vehicle, params: ParameterTable, is_flying: Callable[[], bool]) -> None:
        self._vehicle = vehicle
        self._vehicle_crc = vehicle_crc32(vehicle)
        self._params = params
        self.slot = PolicySlot(params, is_flying)
        self.boot()

    def boot(self) -> None:
        """Start anew: no policy, nothing armed."""
        self.slot.boot()
        self.memory = new_landing_memory()
        self._plan = _NO_PLAN
        self._limits = landing_limits(self._vehicle)
        self._limits_crc = 0
        self._policy_armed = self._trajectory_armed = self._go = self._abort = False
        self._request = _Request(0, False, _NO_PLAN)
        self._consumed = 0
        self._said: dict[Parameter, int] = {}
        self._cues = (math.inf, 0.0, 0.0)
        self._trigger_value = 0.0
        self._a_rot = 0.0
        self._output: LandingOutput | None = None
        self._setpoint = Setpoint()
        self._params[Parameter.VEHICLE_CRC] = self._vehicle_crc

    def connect(self) -> None:
        """Listen to the app's parameters; once, the callbacks outlive reboots."""
        write = self._params.on_write
        write(Parameter.POLICY_ARM, self._on_policy_arm)
        write(Parameter.TRAJECTORY_ARM, self._on_trajectory_arm)
        write(Parameter.GO, self._on_go)
        write(Parameter.ABORT, self._on_abort)

    @property
    def state(self) -> LandingState:
        """State of the landing machine."""
        return LandingState(int(self.memory["state"]))

    def log_sources(self) -> dict[str, Callable[[], Number]]:
        """Where the app's log variables come from."""
        sources: dict[str, Callable[[], Number]] = {
            Log.STATE: lambda: int(self.memory["state"]),
            Log.REASON: lambda: int(self.memory["reason"]),
            Log.TAU: lambda: self._cues[0],
            Log.THETA_X: lambda: self._cues[1],
            Log.D_CEIL: lambda: self._cues[2],
            Log.TRIGGER_VALUE: lambda: self._trigger_value,
            Log.A_ROT: lambda: self._a_rot,
            Log.POLICY_CRC: lambda: self.slot.live_crc,
            Log.POLICY_STATUS: lambda: int(self.slot.status),
            Log.SNAPSHOT_TICK: lambda: round(1000.0 * float(self.memory["snapshot_time"])),
            Log.SNAPSHOT_COUNT: lambda: int(self.memory["snapshot_count"]) & 0xFF,
        }
        for log, field in (
            (Log.SNAPSHOT_TAU, "snapshot_tau"),
            (Log.SNAPSHOT_THETA_X, "snapshot_theta_x"),
            (Log.SNAPSHOT_D_CEIL, "snapshot_d_ceil"),
            (Log.SNAPSHOT_TRIGGER_VALUE, "snapshot_trigger_value"),
            (Log.SNAPSHOT_A_ROT, "snapshot_a_rot"),
            (Log.SNAPSHOT_Z, "snapshot_z"),
            (Log.SNAPSHOT_PITCH, "snapshot_pitch"),
        ):
            sources[log] = partial(self._remembered, field)
        for i, log in enumerate((Log.SNAPSHOT_VX, Log.SNAPSHOT_VY, Log.SNAPSHOT_VZ)):
            sources[log] = partial(self._remembered_velocity, i)
        return sources

    def _remembered(self, field: str) -> float:
        return float(self.memory[field])

    def _remembered_velocity(self, index: int) -> float:
        return float(self.memory["snapshot_velocity"][index])

    def control(self, firmware: "Firmware") -> bool:
        """One ms; True when the app has set the thrusts, False when the controller shall."""
        tick, stabilizer = firmware.tick_ms(), firmware.stabilizer
        if tick % ATTITUDE_PERIOD_MS == 0:
            evaluated = tick % POLICY_PERIOD_MS == 0
            if evaluated:
                self._evaluate(firmware)
            was = self.state
            self._output = self._step(firmware, evaluated)
            if was is LandingState.HOLD and self.state is LandingState.IDLE:
                return self._hand_over(firmware)
        output = self._output
        if output is None or output.mode == OutputMode.PASS:
            return False
        if output.mode == OutputMode.OFF:
            stabilizer.stop()
            return True
        if firmware.setpoint.is_null:
            return False  # somebody wants the motors off: the app never runs them against that
        if output.mode == OutputMode.SETPOINT:
            firmware.setpoint = self._setpoint
            stabilizer.follow(tick, self._setpoint, firmware.estimator, firmware.sensors.gyro)
        elif tick % ATTITUDE_PERIOD_MS == 0:
            _drive(firmware, output, stabilizer)
        return True

    def _evaluate(self, firmware: "Firmware") -> None:
        """Cues and policy on the estimated state."""
        vx, _, vz = firmware.estimator.velocity()
        idle = self.state is LandingState.IDLE
        ceiling_z = float(self._params[Parameter.CEILING_Z]) if idle else self._plan.ceiling_z
        tau, theta_x, d_ceil = optical_flow_cues(firmware.estimator.position()[2], vx, vz, ceiling_z)
        self._cues = (float(tau), float(theta_x), float(d_ceil))
        policy = self.slot.live
        if policy is None:
            self._trigger_value = self._a_rot = 0.0
            return
        self._trigger_value = float(trigger_value(policy, *self._cues))
        self._a_rot = float(action_moment(policy, *self._cues))

    def _step(self, firmware: "Firmware", evaluated: bool) -> LandingOutput:
        """One step of the landing machine: take what is posted, step, answer."""
        if self._limits_crc != self.slot.live_crc:
            self._limits = landing_limits(self._vehicle, self.slot.tau_min)
            self._limits_crc = self.slot.live_crc
        self._take_request()
        was = self.state
        inputs = self._inputs(firmware, evaluated)
        output = landing_step(self.memory, inputs, self._plan, self._limits)
        if output.mode == OutputMode.SETPOINT:
            self._setpoint = _setpoint(output, firmware.tick_ms())
        self._clear_flags(inputs)
        self._answer()
        if self.state is not was and self.state in _CUT:
            firmware.high_level.stop()
        return output

    def _take_request(self) -> None:
        """Consume the posted request, once the machine has seen the switch as the last one left it.

        An armed approach does not change: another plan first disarms, and is armed in the step after.
        """
        request, state = self._request, self.state
        if request.number == self._consumed or self._trajectory_armed != bool(self.memory["arm_seen"]):
            return
        if request.armed and state is LandingState.TRAJECTORY_ARMED and request.plan != self._plan:
            self._trajectory_armed = False
            return
        self._consumed = request.number
        self._trajectory_armed = request.armed
        if request.armed and state is LandingState.IDLE:
            self._plan = request.plan

    def _clear_flags(self, inputs: LandingInputs) -> None:
        """Each flag counts for one step."""
        if inputs.go:
            self._go = False
            self._params[Parameter.GO] = 0
        if self._abort:
            self._abort = False
            self._params[Parameter.ABORT] = 0

    def _answer(self) -> None:
        """Say what the machine makes of it, unless a request is still to be consumed."""
        self._say(Parameter.STATE, int(self.memory["state"]))
        if self._request.number != self._consumed:
            return
        status = int(self.memory["trajectory_status"])
        self._say(Parameter.TRAJECTORY_STATUS, status)
        if status >= TrajectoryStatus.REFUSED_TOO_FAR and self._trajectory_armed:
            self._trajectory_armed = False
            self._params[Parameter.TRAJECTORY_ARM] = 0

    def _say(self, name: Parameter, value: int) -> None:
        if self._said.get(name) != value:
            self._said[name] = value
            self._params[name] = value

    def _hand_over(self, firmware: "Firmware") -> bool:
        """The planner stays where the drone is; until it speaks, 10 ms at most, the last hold stays in force.

        The setpoint of this step is still the planner's old goal, perhaps metres away.
        """
        if firmware.setpoint.is_null:
            return False
        tick, setpoint = firmware.tick_ms(), self._setpoint
        firmware.high_level.hold(firmware.flat_state(), tick / 1000.0)
        firmware.setpoint = setpoint
        firmware.stabilizer.follow(tick, setpoint, firmware.estimator, firmware.sensors.gyro)
        return True

    def _inputs(self, firmware: "Firmware", evaluated: bool) -> LandingInputs:
        estimator, gyro = firmware.estimator, firmware.sensors.gyro
        tau, theta_x, d_ceil = self._cues
        withdrawn = firmware.setpoint.is_null or firmware.supervisor.state is State.WARNING_LEVEL_OUT
        return LandingInputs(
            time=firmware.tick_ms() / 1000.0,
            dt=ATTITUDE_PERIOD_MS / 1000.0,
            position=estimator.position(),
            velocity=estimator.velocity(),
            quaternion=estimator.quaternion(),
            gyro=(float(gyro[0]), float(gyro[1]), float(gyro[2])),
            pose_age=firmware.pose_age(),
            tau=tau,
            theta_x=theta_x,
            d_ceil=d_ceil,
            evaluated=evaluated and self.slot.live is not None,
            trigger_value=self._trigger_value,
            a_rot=self._a_rot,
            policy_armed=self._policy_armed,
            trajectory_armed=self._trajectory_armed,
            go=self._go and not self.memory["go_seen"],
            abort=self._abort or (withdrawn and self.state is not LandingState.IDLE),
            flying=firmware.supervisor.is_flying,
        )

    def _on_policy_arm(self, value: Number) -> None:
        self._policy_armed = bool(value) and self.slot.live is not None
        if value and not self._policy_armed:
            self._params[Parameter.POLICY_ARM] = 0

    def _on_trajectory_arm(self, value: Number) -> Iterator[None]:
        """Post a request, and wait for the control loop."""
        number = self._request.number + 1
        self._say(Parameter.TRAJECTORY_STATUS, int(TrajectoryStatus.NONE))
        self._request = _Request(number, bool(value), self._planned())
        for _ in range(REQUEST_TIMEOUT_MS):
            yield
            if self._consumed == number:
                return

    def _on_go(self, value: Number) -> None:
        self._go = bool(value)

    def _on_abort(self, value: Number) -> None:
        self._abort = bool(value)

    def _planned(self) -> ApproachPlan:
        """The approach of the present parameters; one of NaNs, which nothing accepts, when they make none."""
        p = self._params
        vx, vz = float(p[Parameter.SPEED_X]), float(p[Parameter.SPEED_Z])
        ax, az = float(p[Parameter.ACCELERATION_X]), float(p[Parameter.ACCELERATION_Z])
        if not (ax > 0.0 and az > 0.0):
            return _NO_PLAN
        return plan_from_velocity(
            vx,
            vz,
            float(p[Parameter.IMPACT_X]),
            float(p[Parameter.IMPACT_Y]),
            float(p[Parameter.CEILING_Z]),
            ax,
            az,
            float(p[Parameter.TAU_START]),
        )


def _setpoint(output: LandingOutput, tick_ms: int) -> Setpoint:
    """A complete setpoint of the machine, for the position controller."""
    return Setpoint(
        time_ms=tick_ms,
        mode_x=Mode.ABSOLUTE,
        mode_y=Mode.ABSOLUTE,
        mode_z=Mode.ABSOLUTE,
        mode_yaw=Mode.ABSOLUTE,
        position=output.position,
        velocity=output.velocity,
        acceleration=output.acceleration,
        yaw=output.yaw,
    )


def _drive(firmware: "Firmware", output: LandingOutput, stabilizer: Stabilizer) -> None:
    """Attitude control alone, or thrusts past the controller."""
    if output.mode == OutputMode.THRUSTS:
        stabilizer.thrusts = output.thrusts
        return
    gyro = firmware.sensors.gyro
    omega = (float(gyro[0]), float(gyro[1]), float(gyro[2]))
    stabilizer.apply(
        attitude_control(output.attitude, omega, output.collective, output.yaw, stabilizer.gains)
    )
