"""The reference as the engine of a simulated drone: the functions of :mod:`onboard`, in double precision.

Landing machine and control law at 500 Hz, the policy at 100 Hz. Where the machine flies, it takes the place
of the commander's setpoint; a null or levelled-out setpoint aborts an approach.
"""

import math
from collections.abc import Sequence

import numpy as np

from onboard.app_interface import (
    AVERAGED_MS,
    EndReason,
    LandingState,
    PolicyStatus,
    Rehearsal,
    TrajectoryStatus,
)
from onboard.arrays import Vector
from onboard.controller import Wrench, attitude_control
from onboard.cues import optical_flow_cues
from onboard.landing.braking import hold_setpoint
from onboard.landing.state_machine import (
    LandingInputs,
    LandingOutput,
    OutputMode,
    landing_limits,
    landing_step,
    new_landing_memory,
)
from onboard.mixer import Thrusts
from onboard.policy.action import action_moment
from onboard.policy.bundle import PolicyBundleError, bundle_crc32, decode_bundle
from onboard.policy.model import CompiledPolicy
from onboard.policy.trigger import trigger_value
from onboard.ring import RingRecorder
from onboard.vehicle import Vehicle
from sim_backend.crazyflie.engine import ApproachRequest, EngineEvent, Sample, SnapshotField
from sim_backend.crazyflie.hand_over import HandOver
from sim_backend.crazyflie.power import COMPENSATION_GAIN, FULL_VOLTAGE
from sim_backend.crazyflie.rehearsal import ORIGIN, RehearsalMode
from sim_backend.crazyflie.requests import Posted
from sim_backend.crazyflie.setpoint import Setpoint, complete_setpoint
from sim_backend.crazyflie.stabilizer import CONTROL_PERIOD_MS, Stabilizer

POLICY_PERIOD_MS = 10
_CUT = (LandingState.CUT, LandingState.FAULT)
_SCALARS = {
    SnapshotField.TAU: "snapshot_tau",
    SnapshotField.THETA_X: "snapshot_theta_x",
    SnapshotField.D_CEIL: "snapshot_d_ceil",
    SnapshotField.TRIGGER_VALUE: "snapshot_trigger_value",
    SnapshotField.A_ROT: "snapshot_a_rot",
    SnapshotField.Z: "snapshot_z",
    SnapshotField.PITCH: "snapshot_pitch",
}


class ReferenceEngine:
    """An :class:`~sim_backend.crazyflie.engine.Engine`.

    Attributes:
        state: of the landing machine.
        mode: what it does.
    """

    def __init__(self, vehicle: Vehicle) -> None:
        self._vehicle = vehicle
        self.boot()

    def boot(self) -> None:
        """Start anew."""
        self._stabilizer = Stabilizer(self._vehicle)
        self.ratios = self._stabilizer.ratios
        self._supply = FULL_VOLTAGE
        self._memory = new_landing_memory()
        self.state, self.mode = LandingState.IDLE, OutputMode.PASS
        self._posted = Posted()
        self._limits = landing_limits(self._vehicle)
        self._policy: CompiledPolicy | None = None
        self.live_crc = 0
        self._idle_ceiling_z = 0.0
        self.cues: Vector = (math.inf, 0.0, 0.0)
        self.trigger_value = self.a_rot = 0.0
        self._output: LandingOutput | None = None
        self.target = Setpoint()
        self._rehearsal = RehearsalMode(self._vehicle)
        self._hand_over = HandOver()
        self._recorder = RingRecorder()
        self._recent_ratios = np.zeros((AVERAGED_MS // CONTROL_PERIOD_MS, 4))

    @property
    def mean_ratios(self) -> Sequence[int]:
        """(4,), 0..65535, of the last 10 ms."""
        return tuple(int(mean) for mean in self._recent_ratios.mean(axis=0))

    @property
    def thrusts(self) -> Thrusts:
        """N, M1 to M4."""
        return self._stabilizer.thrusts

    @property
    def wrench(self) -> Wrench:
        """N and N m."""
        return self._stabilizer.wrench

    @property
    def reason(self) -> EndReason:
        """Why the last approach ended."""
        return EndReason(int(self._memory["reason"]))

    @property
    def trajectory_status(self) -> TrajectoryStatus:
        """The answer to the last request."""
        return self._posted.status

    @property
    def snapshot_tick(self) -> int:
        """When the last flip was triggered, ms."""
        return round(1000.0 * float(self._memory["snapshot_time"]))

    @property
    def snapshot_count(self) -> int:
        """Flips so far."""
        return int(self._memory["snapshot_count"])

    def snapshot(self, field: SnapshotField) -> float:
        """One number of the sample that triggered the last flip."""
        if field in _SCALARS:
            return float(self._memory[_SCALARS[field]])
        return float(self._memory["snapshot_velocity"][field - SnapshotField.VX])

    @property
    def has_policy(self) -> bool:
        """Whether a policy is live."""
        return self._policy is not None

    def commit(self, staged: bytes, crc: int, flying: bool) -> PolicyStatus:
        """Make a staged bundle the live policy."""
        if flying:
            return PolicyStatus.REFUSED_FLYING
        if not staged:
            return PolicyStatus.REFUSED_LENGTH
        if bundle_crc32(staged) != crc:
            return PolicyStatus.REFUSED_CRC
        try:
            policy = decode_bundle(staged)
        except PolicyBundleError as error:
            return PolicyStatus(int(error.fault))
        self._policy, self.live_crc = policy.compiled(), crc
        self._limits = landing_limits(self._vehicle, float(policy.tau_min))
        return PolicyStatus.ACTIVE

    def arm_policy(self, on: bool) -> bool:
        """Arm or disarm the policy."""
        self._posted.policy_armed = on and self.has_policy
        return self._posted.policy_armed

    def post(self, armed: bool, approach: ApproachRequest) -> int:
        """Post a request."""
        return self._posted.post(armed, approach)

    def is_consumed(self, number: int) -> bool:
        """Whether request `number` was the last that was taken."""
        return self._posted.is_consumed(number)

    def ask_go(self, on: bool) -> None:
        """Set the flag `go`."""
        self._posted.go = on

    def ask_abort(self, on: bool) -> None:
        """Set the flag `abort`."""
        self._posted.abort = on

    def set_ceiling(self, ceiling_z: float) -> None:
        """Height (m) of the ceiling while nothing is armed."""
        self._idle_ceiling_z = ceiling_z

    def rehearse(self, wanted: int, at_rest: bool) -> Rehearsal:
        """Begin or end a rehearsal."""
        return self._rehearsal.ask(wanted, at_rest, self.state is LandingState.IDLE)

    @property
    def rehearses(self) -> bool:
        """Whether a rehearsal is on."""
        return self._rehearsal.is_on

    @property
    def model(self) -> tuple[Vector, Vector]:
        """Position and velocity of the model."""
        return self._rehearsal.model

    def record(self) -> bytes:
        """The recorder as the ground reads it."""
        return self._recorder.image()

    def step(self, sample: Sample) -> EngineEvent:
        """One ms."""
        events = self._forget(sample) if self._rehearsal.watch(sample) else EngineEvent.NONE
        if self.rehearses:
            self._go_to_start()
            events |= self._compute(self._rehearsal.as_in_flight(sample)) & ~(
                EngineEvent.HANDED_OVER | EngineEvent.CUT
            )
            goal = self.target.position if self.mode is OutputMode.SETPOINT else None
            self._rehearsal.move(sample.tick, self.thrusts, goal)
            self._stabilizer.thrusts = (0.0, 0.0, 0.0, 0.0)
            self.ratios[:] = 0
        else:
            events |= self._compute(sample)
        if sample.tick % CONTROL_PERIOD_MS == 0:
            self._recent_ratios[sample.tick // CONTROL_PERIOD_MS % len(self._recent_ratios)] = self.ratios
        return events

    def _forget(self, sample: Sample) -> EngineEvent:
        """What was armed for a rehearsal must not wait for a flight."""
        self._recorder.end(sample.tick)
        self._memory["state"] = self.state = LandingState.IDLE
        self._memory["attitude_known"] = 0  # Own: that of the model, perhaps upside down.
        self._memory["trajectory_status"] = self._memory["arm_seen"] = 0
        self._posted.withdraw()
        return EngineEvent.REHEARSAL_ENDED

    def _go_to_start(self) -> None:
        """An approach that is about to be armed finds the model at its start."""
        if not self._rehearsal.is_on_model:
            return
        plan = self._posted.to_be_armed(self.state)
        if plan is not None and math.isfinite(plan.x0 + plan.y0 + plan.z0):
            self._start_model((plan.x0, plan.y0, plan.z0))
        elif self._rehearsal.begins:
            self._start_model(ORIGIN)

    def _start_model(self, position: Vector) -> None:
        """The model hovers at `position`, and nothing of an earlier flight is left."""
        self._stabilizer.stop()
        self._memory["attitude_known"] = 0
        self._rehearsal.start(position)

    def _compute(self, sample: Sample) -> EngineEvent:
        """One ms of a drone that flies, or rehearses."""
        events = EngineEvent.NONE
        if math.isfinite(sample.voltage):  # one that is not would stay for ever
            self._supply += COMPENSATION_GAIN * (sample.voltage - self._supply)
        if sample.tick % CONTROL_PERIOD_MS == 0:
            if sample.tick % POLICY_PERIOD_MS == 0:
                self._evaluate(sample)
            events = self._step_machine(sample)
        self._fly(sample)
        self._stabilizer.drive(self._supply)
        if self._recorder.records(sample.tick):
            self._record(sample)
        return events

    def _record(self, sample: Sample) -> None:
        estimator, memory = sample.estimator, self._memory
        x, y, z = sample.gyro
        own = memory["attitude"]
        self._recorder.record(
            sample.tick,
            (self.cues, self.trigger_value, self.a_rot),
            (estimator.position(), estimator.velocity(), estimator.quaternion(), (x, y, z)),
            (own[0], own[1], own[2], own[3]),
            self._supply,
            self.thrusts,
        )

    def _evaluate(self, sample: Sample) -> None:
        """Cues and policy on the estimated state."""
        vx, _, vz = sample.estimator.velocity()
        idle = self.state is LandingState.IDLE
        ceiling_z = self._idle_ceiling_z if idle else self._posted.plan.ceiling_z
        tau, theta_x, d_ceil = optical_flow_cues(sample.estimator.position()[2], vx, vz, ceiling_z)
        self.cues = (float(tau), float(theta_x), float(d_ceil))
        self.trigger_value = self.a_rot = 0.0
        if self._policy is not None:
            self.trigger_value = float(trigger_value(self._policy, *self.cues))
            self.a_rot = float(action_moment(self._policy, *self.cues))

    def _step_machine(self, sample: Sample) -> EngineEvent:
        """One step of the landing machine: take what is posted, step, answer."""
        was, posted, memory = self.state, self._posted, self._memory
        posted.take(was, bool(memory["arm_seen"]))
        inputs = self._inputs(sample)
        self._output = landing_step(memory, inputs, posted.plan, self._limits)
        self.state = LandingState(int(memory["state"]))
        events = posted.clear_flags(inputs.go) | posted.answer(
            TrajectoryStatus(int(memory["trajectory_status"]))
        )
        events |= self._change(sample, was)
        if self._hand_over.holds_on(sample, self.state, events):
            p, v, a = hold_setpoint(memory, inputs.time, posted.plan, self._limits)
            self._output = self._output._replace(
                mode=OutputMode.SETPOINT, position=p, velocity=v, acceleration=a
            )
        self.mode = OutputMode(self._output.mode)
        if self.mode is OutputMode.SETPOINT:
            self.target = _setpoint(self._output)
        return events

    def _inputs(self, sample: Sample) -> LandingInputs:
        estimator, gyro, posted = sample.estimator, sample.gyro, self._posted
        tau, theta_x, d_ceil = self.cues
        withdrawn = sample.setpoint.is_null or sample.levelling
        evaluated = self._policy is not None and sample.tick % POLICY_PERIOD_MS == 0
        return LandingInputs(
            time=sample.tick / 1000.0,
            dt=CONTROL_PERIOD_MS / 1000.0,
            position=estimator.position(),
            velocity=estimator.velocity(),
            quaternion=estimator.quaternion(),
            gyro=(float(gyro[0]), float(gyro[1]), float(gyro[2])),
            pose_age=math.inf if sample.pose_age is None else sample.pose_age / 1000.0,
            tau=tau,
            theta_x=theta_x,
            d_ceil=d_ceil,
            evaluated=evaluated,
            trigger_value=self.trigger_value,
            a_rot=self.a_rot,
            policy_armed=posted.policy_armed,
            trajectory_armed=posted.trajectory_armed,
            go=posted.go and not self._memory["go_seen"],
            abort=posted.abort or (withdrawn and self.state is not LandingState.IDLE),
            flying=sample.flying,
        )

    def _change(self, sample: Sample, was: LandingState) -> EngineEvent:
        """What a change of the machine's state means for others."""
        state = self.state
        if state is not was and state is LandingState.TRAJECTORY_ARMED:
            self._recorder.begin()
        elif state is not was and was is LandingState.APPROACH:
            self._recorder.end(sample.tick)
        if state is not was and state in _CUT:
            return EngineEvent.CUT
        if was is LandingState.HOLD and state is LandingState.IDLE and not sample.setpoint.is_null:
            return EngineEvent.HANDED_OVER
        return EngineEvent.NONE

    def _fly(self, sample: Sample) -> None:
        stabilizer, mode = self._stabilizer, self.mode
        if mode is OutputMode.OFF or sample.setpoint.is_null:
            stabilizer.stop()  # never runs the motors against somebody who wants them off
        elif mode is OutputMode.SETPOINT:
            stabilizer.follow(sample.tick, self.target, sample.tick, sample.estimator, sample.gyro)
        elif mode is OutputMode.PASS:
            stabilizer.follow(sample.tick, sample.setpoint, sample.set_at, sample.estimator, sample.gyro)
        elif self._output is not None and sample.tick % CONTROL_PERIOD_MS == 0:
            self._drive(self._output, sample)

    def _drive(self, output: LandingOutput, sample: Sample) -> None:
        """Attitude control alone, or thrusts past the controller."""
        stabilizer, gyro = self._stabilizer, sample.gyro
        if output.mode == OutputMode.THRUSTS:
            stabilizer.thrusts = output.thrusts
            return
        omega = (float(gyro[0]), float(gyro[1]), float(gyro[2]))
        stabilizer.apply(
            attitude_control(output.attitude, omega, output.collective, output.yaw, stabilizer.gains)
        )


def _setpoint(output: LandingOutput) -> Setpoint:
    """A complete setpoint of the machine, for the position controller."""
    return complete_setpoint(output.position, output.velocity, output.acceleration, output.yaw)
