"""The drone's own code in C as the engine of a simulated drone: single precision, as it flies."""

import ctypes
import struct
from collections.abc import Sequence
from typing import Any

import numpy as np

from onboard.app_interface import (
    RECORD_ADDRESS,
    EndReason,
    LandingState,
    PolicyStatus,
    Rehearsal,
    TrajectoryStatus,
)
from onboard.arrays import Vector
from onboard.battery import FULL_RATIO
from onboard.controller import Wrench
from onboard.firmware.library import NO_POSE, Float32Array, core_library, vehicle_constants
from onboard.firmware.structures import (
    PerchApproach,
    PerchEstimate,
    PerchInputs,
    PerchOutputs,
    PerchSetpoint,
    PerchVector,
    PerchView,
)
from onboard.landing.model import OutputMode
from onboard.mixer import Thrusts
from onboard.ring import RING_BYTES
from onboard.vehicle import Vehicle
from sim_backend.crazyflie.engine import ApproachRequest, EngineEvent, Sample, SnapshotField
from sim_backend.crazyflie.setpoint import Setpoint, complete_setpoint

_WORD = ctypes.sizeof(ctypes.c_float)
_ESTIMATE = struct.Struct(f"={ctypes.sizeof(PerchEstimate) // _WORD}f")
"""Ten of the filter, three of the gyro: in a quarter of the time that numpy takes for so few."""
_MODES = {int(mode): mode for mode in OutputMode}
_STATES = {int(state): state for state in LandingState}
_STATUSES = {int(status): status for status in TrajectoryStatus}
"""By number: asked for every ms, and to call an enumeration takes longer than a step of the core."""


def _floats_at(structure: Any, offset: int, end: int) -> Float32Array:
    """The float32 of a structure between two places, in bytes, to be written all at once."""
    return np.frombuffer(structure, dtype=np.float32, count=(end - offset) // _WORD, offset=offset)


class CEngine:
    """An :class:`~sim_backend.crazyflie.engine.Engine`."""

    def __init__(self, vehicle: Vehicle) -> None:
        """Raises NoCompiler or CompilationFailed (:mod:`onboard.firmware.compiler`)."""
        self._library = core_library()
        self._host_step = self._library.perch_host_step  # looked up once, called a thousand times a second
        self._constants = vehicle_constants(vehicle)  # the core keeps only where they are
        self._core = ctypes.create_string_buffer(self._library.core_bytes)
        self._inputs, self._view = PerchInputs(), PerchView()
        begin = PerchInputs.estimate.offset
        self._estimate = _floats_at(self._inputs, begin, begin + ctypes.sizeof(PerchEstimate))
        begin, size = (
            PerchInputs.setpoint.offset + PerchSetpoint.position.offset,
            ctypes.sizeof(PerchSetpoint),
        )
        self._setpoint = _floats_at(self._inputs, begin, PerchInputs.setpoint.offset + size)
        self._snapshot: Float32Array = np.zeros(len(SnapshotField), np.float32)
        self.ratios = np.zeros(4, dtype=np.int64)
        self.boot()

    def boot(self) -> None:
        """Start anew."""
        self._library.perch_boot(self._core, self._constants)
        self._taken: Setpoint | None = None
        self._view = PerchView()
        begin = PerchView.outputs.offset + PerchOutputs.duties.offset
        self._duties = _floats_at(self._view, begin, begin + 4 * _WORD)
        self._view.outputs.policy.cues.tau = float("inf")
        self.ratios[:] = 0

    @property
    def thrusts(self) -> Thrusts:
        """N, M1 to M4."""
        m1, m2, m3, m4 = self._view.outputs.thrusts
        return (m1, m2, m3, m4)

    @property
    def mean_ratios(self) -> Sequence[int]:
        """(4,), 0..65535, of the last 10 ms."""
        return tuple(self._view.outputs.mean_ratios)

    @property
    def wrench(self) -> Wrench:
        """N and N m."""
        wrench = self._view.outputs.wrench
        return (wrench.collective, wrench.tau_x, wrench.tau_y, wrench.tau_z)

    @property
    def mode(self) -> OutputMode:
        """What the landing machine does."""
        return _MODES[self._view.outputs.mode]

    @property
    def target(self) -> Setpoint:
        """What is tracked in mode SETPOINT."""
        motion = self._view.outputs.motion
        return complete_setpoint(
            _vector(motion.position),
            _vector(motion.velocity),
            _vector(motion.acceleration),
        )

    @property
    def state(self) -> LandingState:
        """Of the landing machine."""
        return _STATES[self._view.outputs.state]

    @property
    def reason(self) -> EndReason:
        """Why the last approach ended."""
        return EndReason(self._view.outputs.reason)

    @property
    def trajectory_status(self) -> TrajectoryStatus:
        """The answer to the last request."""
        return _STATUSES[self._view.outputs.trajectory_status]

    @property
    def cues(self) -> Vector:
        """tau (s), theta_x (rad/s), d_ceil (m)."""
        cues = self._view.outputs.policy.cues
        return (cues.tau, cues.theta_x, cues.d_ceil)

    @property
    def trigger_value(self) -> float:
        """Of the last evaluation."""
        return float(self._view.outputs.policy.trigger_value)

    @property
    def a_rot(self) -> float:
        """Of the last evaluation, N m."""
        return float(self._view.outputs.policy.a_rot)

    @property
    def snapshot_tick(self) -> int:
        """When the last flip was triggered, ms."""
        return int(self._view.snapshot.tick)

    @property
    def snapshot_count(self) -> int:
        """Flips so far."""
        return int(self._view.snapshot.count)

    def snapshot(self, field: SnapshotField) -> float:
        """One number of the sample that triggered the last flip: they lie in this order."""
        begin = PerchView.snapshot.offset + _WORD * (1 + field)
        return float(_floats_at(self._view, begin, begin + _WORD)[0])

    @property
    def has_policy(self) -> bool:
        """Whether a policy is live."""
        return self.live_crc != 0

    @property
    def live_crc(self) -> int:
        """CRC-32 of the live policy's bundle."""
        return int(self._library.perch_live_crc(self._core))

    def commit(self, staged: bytes, crc: int, flying: bool) -> PolicyStatus:
        """Make a staged bundle the live policy."""
        library = self._library
        if not flying and staged:
            library.perch_memory_write(self._core, 0, len(staged), staged, flying)
        return PolicyStatus(library.perch_commit(self._core, len(staged), crc, flying))

    def arm_policy(self, on: bool) -> bool:
        """Arm or disarm the policy."""
        return bool(self._library.perch_arm_policy(self._core, on))

    def post(self, armed: bool, approach: ApproachRequest) -> int:
        """Post a request."""
        self._view.outputs.trajectory_status = TrajectoryStatus.NONE
        return int(self._library.perch_post(self._core, armed, PerchApproach(*approach)))

    def is_consumed(self, number: int) -> bool:
        """Whether request `number` was the last that was taken."""
        return bool(self._library.perch_is_consumed(self._core, number))

    def ask_go(self, on: bool) -> None:
        """Set the flag `go`."""
        self._library.perch_ask_go(self._core, on)

    def ask_abort(self, on: bool) -> None:
        """Set the flag `abort`."""
        self._library.perch_ask_abort(self._core, on)

    def rehearse(self, wanted: int, at_rest: bool) -> Rehearsal:
        """Begin or end a rehearsal."""
        taken = Rehearsal(self._library.perch_rehearse(self._core, wanted, at_rest))
        self._view.outputs.rehearses = bool(taken)
        return taken

    @property
    def rehearses(self) -> bool:
        """Whether a rehearsal is on."""
        return bool(self._view.outputs.rehearses)

    @property
    def model(self) -> tuple[Vector, Vector]:
        """Position and velocity of the model."""
        estimate = self._view.model.estimate
        return _vector(estimate.position), _vector(estimate.velocity)

    def record(self) -> bytes:
        """The recorder as the ground reads it."""
        image = ctypes.create_string_buffer(RING_BYTES)
        self._library.perch_memory_read(self._core, RECORD_ADDRESS, RING_BYTES, image)
        return image.raw

    def set_ceiling(self, ceiling_z: float) -> None:
        """Height (m) of the ceiling while nothing is armed."""
        self._library.perch_set_ceiling(self._core, ceiling_z)

    def step(self, sample: Sample) -> EngineEvent:
        """One ms."""
        inputs, state = self._inputs, sample.estimator.state
        inputs.tick = sample.tick
        inputs.pose_age = NO_POSE if sample.pose_age is None else sample.pose_age
        inputs.voltage = sample.voltage
        inputs.flying = sample.flying
        inputs.levelling = sample.levelling
        inputs.thrust_seen = sample.thrust_seen
        known = (*state.tolist()[:10], *sample.gyro.tolist())
        try:
            _ESTIMATE.pack_into(inputs, PerchInputs.estimate.offset, *known)
        except OverflowError:
            with np.errstate(over="ignore"):  # an estimate that diverges becomes infinite, as on the drone
                self._estimate[:] = known
        self._take_setpoint(sample.setpoint, sample.tick - sample.set_at)
        self._host_step(self._core, inputs, self._view)
        self.ratios[:] = [int(duty * FULL_RATIO) for duty in self._duties.tolist()]
        events = self._view.outputs.events
        return EngineEvent(events) if events else EngineEvent.NONE

    def _take_setpoint(self, s: Setpoint, age_ms: int) -> None:
        self._setpoint[-1] = 1e-3 * age_ms
        if s is self._taken:  # one is in force for many ms, and only ages
            return
        self._taken = s
        c = self._inputs.setpoint
        c.mode[0], c.mode[1], c.mode[2] = s.mode_x, s.mode_y, s.mode_z
        c.mode_roll, c.mode_pitch, c.mode_yaw = s.mode_roll, s.mode_pitch, s.mode_yaw
        c.mode_quaternion, c.velocity_body = s.mode_quat, s.velocity_body
        angles = (s.roll, s.pitch, s.yaw)
        with np.errstate(over="ignore"):
            self._setpoint[:-1] = (
                *s.position, *s.velocity, *s.acceleration, *angles, *s.rates, *s.quaternion, s.thrust,
            )  # fmt: skip


def _vector(v: PerchVector) -> Vector:
    return (v.x, v.y, v.z)
