"""Our firmware app in the simulated drone: the landing machine behind :mod:`onboard.app_interface`.

The landing machine runs at the controller's 500 Hz, the policy at 100 Hz on the estimated state. Where the
app flies, it takes the place of the controller (on the real drone it is an out-of-tree controller); the
supervisor's motor gate stays in force, and a null or levelled-out setpoint aborts an approach. When the app
hands back after a brake, the high-level commander is told to stay where the drone is; when it cuts, the
commander's plan is dropped.
"""

import math
from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING

from onboard.app_interface import LandingState, Log, Parameter, TrajectoryStatus
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


class LandingApp:
    """The app of one drone.

    Attributes:
        slot: staged and live policy.
        memory: the landing machine's record (:data:`onboard.landing.model.LANDING_MEMORY`).
    """

    def __init__(self, vehicle: Vehicle, params: ParameterTable, is_flying: Callable[[], bool]) -> None:
        self._vehicle = vehicle
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
        self._ceiling_z = 0.0
        self._policy_armed = self._trajectory_armed = self._go = self._abort = False
        self._status = 0
        self._cues = (math.inf, 0.0, 0.0)
        self._trigger_value = 0.0
        self._a_rot = 0.0
        self._output: LandingOutput | None = None
        self._setpoint = Setpoint()

    def connect(self, firmware: "Firmware") -> None:
        """Listen to the app's parameters; once, they outlive reboots."""
        write = self._params.on_write
        write(Parameter.CEILING_Z, self._on_ceiling)
        write(Parameter.POLICY_ARM, self._on_policy_arm)
        write(Parameter.TRAJECTORY_ARM, lambda value: self._on_trajectory_arm(firmware, value))
        write(Parameter.GO, lambda value: self._on_go(firmware, value))
        write(Parameter.ABORT, lambda value: self._on_abort(firmware, value))

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
            self._output = self._step(firmware, ATTITUDE_PERIOD_MS / 1000.0, evaluated)
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
        tau, theta_x, d_ceil = optical_flow_cues(firmware.estimator.position()[2], vx, vz, self._ceiling_z)
        self._cues = (float(tau), float(theta_x), float(d_ceil))
        policy = self.slot.live
        if policy is None:
            self._trigger_value = self._a_rot = 0.0
            return
        self._trigger_value = float(trigger_value(policy, *self._cues))
        self._a_rot = float(action_moment(policy, *self._cues))

    def _step(self, firmware: "Firmware", dt: float, evaluated: bool) -> LandingOutput:
        """One step of the landing machine and what follows from a change of its state."""
        if self._limits_crc != self.slot.live_crc:
            self._limits = landing_limits(self._vehicle, self.slot.tau_min)
            self._limits_crc = self.slot.live_crc
        was = self.state
        output = landing_step(self.memory, self._inputs(firmware, dt, evaluated), self._plan, self._limits)
        self._setpoint = Setpoint(
            time_ms=firmware.tick_ms(),
            mode_x=Mode.ABSOLUTE,
            mode_y=Mode.ABSOLUTE,
            mode_z=Mode.ABSOLUTE,
            mode_yaw=Mode.ABSOLUTE,
            position=output.position,
            velocity=output.velocity,
            acceleration=output.acceleration,
            yaw=output.yaw,
        )
        self._after(firmware, was)
        return output

    def _inputs(self, firmware: "Firmware", dt: float, evaluated: bool) -> LandingInputs:
        estimator, gyro = firmware.estimator, firmware.sensors.gyro
        tau, theta_x, d_ceil = self._cues
        withdrawn = firmware.setpoint.is_null or firmware.supervisor.state is State.WARNING_LEVEL_OUT
        return LandingInputs(
            time=firmware.tick_ms() / 1000.0,
            dt=dt,
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
            go=self._go,
            abort=self._abort or (withdrawn and self.state is not LandingState.IDLE),
            flying=firmware.supervisor.is_flying,
        )

    def _after(self, firmware: "Firmware", was: LandingState) -> None:
        """Keep the parameters true and the high-level commander in step."""
        state, status = self.state, int(self.memory["trajectory_status"])
        if status != self._status:
            self._status = status
            self._params[Parameter.TRAJECTORY_STATUS] = status
        if status >= TrajectoryStatus.REFUSED_TOO_FAR and self._trajectory_armed:
            self._trajectory_armed = False
            self._params[Parameter.TRAJECTORY_ARM] = 0
        if state is was:
            return
        if state in _CUT:
            firmware.high_level.stop()
        elif was is LandingState.HOLD and state is LandingState.IDLE:
            firmware.high_level.hold(firmware.flat_state(), firmware.tick_ms() / 1000.0)

    def _on_ceiling(self, value: Number) -> None:
        self._ceiling_z = float(value)

    def _on_policy_arm(self, value: Number) -> None:
        self._policy_armed = bool(value) and self.slot.live is not None
        if value and not self._policy_armed:
            self._params[Parameter.POLICY_ARM] = 0

    def _on_trajectory_arm(self, firmware: "Firmware", value: Number) -> None:
        self._trajectory_armed = bool(value)
        if value and self.state is LandingState.IDLE:
            self._plan = self._planned()
        # Steps of no time: the answer stands in trjStat before the client can ask for it, and after a refusal
        # the machine has seen the flag go down.
        self._step(firmware, 0.0, evaluated=False)
        self._step(firmware, 0.0, evaluated=False)

    def _on_go(self, firmware: "Firmware", value: Number) -> None:
        if not value:
            return
        self._go = True
        self._step(firmware, 0.0, evaluated=False)
        self._go = False
        self._step(firmware, 0.0, evaluated=False)
        self._params[Parameter.GO] = 0

    def _on_abort(self, firmware: "Firmware", value: Number) -> None:
        if not value:
            return
        self._abort = True
        self._step(firmware, 0.0, evaluated=False)
        self._abort = False
        self._params[Parameter.ABORT] = 0

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
            self._ceiling_z,
            ax,
            az,
            float(p[Parameter.TAU_START]),
        )


def _drive(firmware: "Firmware", output: LandingOutput, stabilizer: Stabilizer) -> None:
    """Attitude control alone, or thrusts past the controller."""
    if output.mode == OutputMode.THRUSTS:
        stabilizer.thrusts = output.thrusts
        return
    gyro = firmware.sensors.gyro
    omega = (float(gyro[0]), float(gyro[1]), float(gyro[2]))
    wrench = attitude_control(output.attitude, omega, output.collective, output.yaw, stabilizer.gains)
    stabilizer.wrench = wrench
    stabilizer.thrusts = stabilizer.mix(wrench)
