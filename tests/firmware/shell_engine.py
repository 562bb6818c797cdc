"""The whole landing app, shell included, as the engine of a simulated drone."""

import math
import shutil
import tempfile
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from onboard.app_interface import (
    RECORD_ADDRESS,
    EndReason,
    LandingState,
    Log,
    Parameter,
    PolicyStatus,
    Rehearsal,
    TrajectoryStatus,
)
from onboard.arrays import Vector
from onboard.battery import FULL_RATIO
from onboard.controller import Wrench
from onboard.firmware.constants import vehicle_crc32
from onboard.landing.model import OutputMode
from onboard.mixer import Thrusts
from onboard.ring import RING_BYTES
from onboard.vehicle import Vehicle
from sim_backend.crazyflie.engine import ApproachRequest, EngineEvent, Sample, SnapshotField
from sim_backend.crazyflie.setpoint import Setpoint, complete_setpoint
from tests.firmware.shell import Shell, build_shell

APPROACH = (
    Parameter.SPEED_X, Parameter.SPEED_Z, Parameter.IMPACT_X, Parameter.IMPACT_Y,
    Parameter.CEILING_Z, Parameter.ACCELERATION_X, Parameter.ACCELERATION_Z, Parameter.TAU_START,
)  # fmt: skip
"""In the order of an `ApproachRequest`."""

FLAGS = {
    Parameter.GO: EngineEvent.GO_TAKEN,
    Parameter.ABORT: EngineEvent.ABORT_TAKEN,
    Parameter.TRAJECTORY_ARM: EngineEvent.REFUSED,
    Parameter.REHEARSE: EngineEvent.REHEARSAL_ENDED,
}
"""Switches that the app takes back, and what that says."""

MEANS = (Log.MEAN_M1, Log.MEAN_M2, Log.MEAN_M3, Log.MEAN_M4)


_folders: dict[int, "tempfile.TemporaryDirectory[str]"] = {}
"""Of each vehicle that an app was compiled for, until this process ends."""


def _built(vehicle: Vehicle) -> Path:
    """The app with the constants of a vehicle."""
    name = vehicle_crc32(vehicle)
    if name not in _folders:
        _folders[name] = tempfile.TemporaryDirectory(prefix="shell")
        build_shell(Path(_folders[name].name), vehicle)
    return Path(_folders[name].name, "shell.so")


class ShellEngine:
    """An :class:`~sim_backend.crazyflie.engine.Engine` of which every word goes through the shell.

    Requests are writes of its parameters, samples are the firmware's structures in their units, and what it
    asks of the planner are calls.
    """

    def __init__(self, vehicle: Vehicle) -> None:
        self._library = _built(vehicle)
        self.ratios = np.zeros(4, dtype=np.int64)
        self.boot()

    def boot(self) -> None:
        """Start anew: another copy of the library, for one holds one app."""
        with tempfile.TemporaryDirectory() as folder:
            self._shell = Shell(Path(shutil.copy(self._library, folder)))
        self._shell.set(Parameter.OWN_LAW, 1)
        self.ratios[:] = 0
        self._posted = 0

    @property
    def thrusts(self) -> Thrusts:
        m1, m2, m3, m4 = self._shell.outputs.thrusts
        return (m1, m2, m3, m4)

    @property
    def wrench(self) -> Wrench:
        w = self._shell.outputs.wrench
        return (w.collective, w.tau_x, w.tau_y, w.tau_z)

    @property
    def mode(self) -> OutputMode:
        return OutputMode(self._shell.outputs.mode)

    @property
    def target(self) -> Setpoint:
        p, v, a = (getattr(self._shell.outputs.motion, n) for n in ("position", "velocity", "acceleration"))
        return complete_setpoint((p.x, p.y, p.z), (v.x, v.y, v.z), (a.x, a.y, a.z))

    @property
    def mean_ratios(self) -> Sequence[int]:
        return [int(self._shell.log(name)) for name in MEANS]

    @property
    def state(self) -> LandingState:
        return LandingState(int(self._shell.log(Log.STATE)))

    @property
    def reason(self) -> EndReason:
        return EndReason(int(self._shell.log(Log.REASON)))

    @property
    def trajectory_status(self) -> TrajectoryStatus:
        return TrajectoryStatus(int(self._shell.read(Parameter.TRAJECTORY_STATUS)))

    @property
    def cues(self) -> Vector:
        return (self._shell.log(Log.TAU), self._shell.log(Log.THETA_X), self._shell.log(Log.D_CEIL))

    @property
    def trigger_value(self) -> float:
        return self._shell.log(Log.TRIGGER_VALUE)

    @property
    def a_rot(self) -> float:
        return self._shell.log(Log.A_ROT)

    @property
    def snapshot_tick(self) -> int:
        return int(self._shell.log(Log.SNAPSHOT_TICK))

    @property
    def snapshot_count(self) -> int:
        return int(self._shell.log(Log.SNAPSHOT_COUNT))

    def snapshot(self, field: SnapshotField) -> float:
        return self._shell.log(Log[f"SNAPSHOT_{field.name}"])

    @property
    def live_crc(self) -> int:
        return int(self._shell.read(Parameter.POLICY_ACTIVE_CRC))

    @property
    def has_policy(self) -> bool:
        return self.live_crc != 0

    def commit(self, staged: bytes, crc: int, flying: bool) -> PolicyStatus:
        self._shell.world.flying = flying
        if not flying:
            self._shell.upload(staged)
        self._shell.set(Parameter.POLICY_LENGTH, len(staged))
        self._shell.set(Parameter.POLICY_CRC, crc)
        self._shell.set(Parameter.POLICY_COMMIT, 1)
        return PolicyStatus(int(self._shell.read(Parameter.POLICY_STATUS)))

    def arm_policy(self, on: bool) -> bool:
        assert self._shell.write(Parameter.POLICY_ARM, on)
        return self._shell.read(Parameter.POLICY_ARM) == 1

    def post(self, armed: bool, approach: ApproachRequest) -> int:
        for name, value in zip(APPROACH, approach, strict=True):
            assert self._shell.write(name, value)
        assert self._shell.write(Parameter.TRAJECTORY_ARM, armed)
        self._posted += 1
        return self._posted

    def is_consumed(self, number: int) -> bool:
        return number == self._posted and not self._shell.callback_waits

    def ask_go(self, on: bool) -> None:
        assert self._shell.write(Parameter.GO, on)

    def ask_abort(self, on: bool) -> None:
        assert self._shell.write(Parameter.ABORT, on)

    def rehearse(self, wanted: int, at_rest: bool) -> Rehearsal:
        self._shell.world.armed = self._shell.world.armed or not at_rest
        assert self._shell.write(Parameter.REHEARSE, wanted)
        return Rehearsal(int(self._shell.read(Parameter.REHEARSE)))

    @property
    def rehearses(self) -> bool:
        return self._shell.read(Parameter.REHEARSE) != Rehearsal.OFF

    @property
    def model(self) -> tuple[Vector, Vector]:
        x, y, z, vx, vy, vz = (self._shell.log(name) for name in Log if name.startswith("perchM."))
        return (x, y, z), (vx, vy, vz)

    def record(self) -> bytes:
        parts = (
            self._shell.read_memory(RECORD_ADDRESS + place, min(24, RING_BYTES - place))
            for place in range(0, RING_BYTES, 24)
        )
        return b"".join(part or b"" for part in parts)

    def set_ceiling(self, ceiling_z: float) -> None:
        assert self._shell.write(Parameter.CEILING_Z, ceiling_z)

    def step(self, sample: Sample) -> EngineEvent:
        """One ms of the firmware around the shell."""
        shell = self._shell
        self._show(sample)
        before = {name: shell.read(name) for name in FLAGS}
        stops, goals = shell.asked.planner_stops, shell.asked.planner_goals
        shell.world.tick_ms, shell.step_number = sample.tick - 1, sample.tick
        shell.step()
        self.ratios[:] = [int(force * FULL_RATIO) for force in shell.control.forces]
        events = EngineEvent.NONE
        for name, event in FLAGS.items():
            if before[name] != 0 and shell.read(name) == 0:
                events |= event
        if shell.asked.planner_goals > goals:
            events |= EngineEvent.HANDED_OVER
        elif shell.asked.planner_stops > stops:
            events |= EngineEvent.CUT
        return events

    def _show(self, sample: Sample) -> None:
        """What the firmware hands to its controller, and what it tells when it is asked."""
        shell, estimator = self._shell, sample.estimator
        world, state, sensors = shell.world, shell.state, shell.sensors
        world.voltage, world.flying, world.armed = sample.voltage, sample.flying, sample.flying
        if sample.pose_age is not None:
            world.pose_tick = (sample.tick - sample.pose_age) % 65536
        world.motors[:] = [int(ratio) for ratio in self.ratios]
        state.position.x, state.position.y, state.position.z = estimator.position()
        state.velocity.x, state.velocity.y, state.velocity.z = estimator.velocity()
        q = state.quaternion
        q.x, q.y, q.z, q.w = estimator.quaternion()
        sensors.gyro.x, sensors.gyro.y, sensors.gyro.z = np.degrees(sample.gyro).tolist()
        self._show_setpoint(sample.setpoint, sample.set_at)

    def _show_setpoint(self, s: Setpoint, set_at: int) -> None:
        theirs = self._shell.setpoint
        theirs.timestamp, theirs.thrust, theirs.velocity_body = set_at, s.thrust, s.velocity_body
        for name in ("x", "y", "z", "roll", "pitch", "yaw", "quat"):
            setattr(theirs, f"mode_{name}", int(getattr(s, f"mode_{name}")))
        for name in ("position", "velocity", "acceleration"):
            v = getattr(theirs, name)
            v.x, v.y, v.z = getattr(s, name)
        q, angles, rates = theirs.quaternion, theirs.attitude, theirs.rates
        q.x, q.y, q.z, q.w = s.quaternion
        # Degrees, and pitch with the legacy sign.
        angles.x, angles.y, angles.z = math.degrees(s.roll), -math.degrees(s.pitch), math.degrees(s.yaw)
        rates.x, rates.y, rates.z = (
            math.degrees(s.rates[0]),
            -math.degrees(s.rates[1]),
            math.degrees(s.rates[2]),
        )
