"""The landing machine in C behind the face of the reference's, so that the reference's tests can ask it."""

import math
from ctypes import c_float
from typing import Any

import numpy as np

from onboard.arrays import Vector as ThreeNumbers
from onboard.firmware.constants import onboard_constants
from onboard.firmware.library import NO_POSE, CoreLibrary
from onboard.firmware.structures import (
    PerchCues,
    PerchLandingInputs,
    PerchLandingMemory,
    PerchLandingOutput,
    PerchPlan,
    PerchQuaternion,
    PerchVector,
)
from onboard.landing import model
from onboard.trajectory import ApproachPlan
from onboard.vehicle import Vehicle

_FLAGS = ("state", "trajectory_status", "reason", "arm_seen", "go_seen", "attitude_known")
_CLOCKS = ("start", "flip", "usable", "hold")
_CUES = ("tau", "theta_x", "d_ceil")
_SNAPSHOT = ("trigger_value", "a_rot", "z", "pitch", "count")


class LandingInC:
    """A machine's step as :func:`onboard.landing.state_machine.landing_step`, of times in whole ms.

    Args:
        library: with the core.
        vehicle: whose constants count where the limits say nothing.
    """

    def __init__(self, library: CoreLibrary, vehicle: Vehicle) -> None:
        self._library = library
        self._constants = {constant.name: constant.value for constant in onboard_constants(vehicle)}

    def step(
        self, memory: Any, inputs: model.LandingInputs, plan: ApproachPlan, limits: model.LandingLimits
    ) -> model.LandingOutput:
        """One step; the memory is the reference's, in place."""
        mine, output = _memory(memory), PerchLandingOutput()
        self._library.perch_host_landing(
            mine, _inputs(inputs, limits), PerchPlan(*plan), self._vehicle(limits), output
        )
        _remember(mine, memory, inputs.time)
        motion, own = output.motion, memory["attitude"]
        return model.LandingOutput(
            output.mode,
            _three(motion.position),
            _three(motion.velocity),
            _three(motion.acceleration),
            0.0,
            output.collective,
            tuple(output.thrusts),
            (own[0], own[1], own[2], own[3]),
        )

    def _vehicle(self, limits: model.LandingLimits) -> Any:
        known = {f"limit_{name}": value for name, value in limits._asdict().items()}
        known |= {"arm_x": limits.arm_x, "thrust_max": limits.thrust_max}
        values = [known.get(name, value) for name, value in self._constants.items()]
        return (c_float * len(values))(*values)


def _tick(time: float) -> int:
    return round(1000.0 * time) & 0xFFFFFFFF if math.isfinite(time) else 0


def _three(v: PerchVector) -> ThreeNumbers:
    return (v.x, v.y, v.z)


def _inputs(i: model.LandingInputs, limits: model.LandingLimits) -> PerchLandingInputs:
    age = NO_POSE if not math.isfinite(i.pose_age) else round(1000.0 * i.pose_age)
    return PerchLandingInputs(
        _tick(i.time), age, i.dt,
        PerchVector(*i.position), PerchVector(*i.velocity), PerchQuaternion(*i.quaternion),
        PerchVector(*i.gyro), PerchCues(i.tau, i.theta_x, i.d_ceil),
        i.trigger_value, i.a_rot, limits.policy_tau_min,
        i.evaluated, i.policy_armed, i.trajectory_armed, i.go, i.abort, i.flying,
    )  # fmt: skip


def _memory(m: Any) -> PerchLandingMemory:
    mine = PerchLandingMemory(
        *(int(m[name]) for name in _FLAGS),
        PerchQuaternion(*m["attitude"]),
        *(_tick(float(m[f"{name}_time"])) for name in _CLOCKS),
        PerchVector(*m["hold_position"]),
        PerchVector(*m["hold_velocity"]),
    )
    mine.snapshot.tick = _tick(float(m["snapshot_time"]))
    mine.snapshot.cues = PerchCues(*(m[f"snapshot_{name}"] for name in _CUES))
    mine.snapshot.velocity = PerchVector(*m["snapshot_velocity"])
    for name in _SNAPSHOT:
        value = m[f"snapshot_{name}"]
        setattr(mine.snapshot, name, int(value) if name == "count" else value)
    return mine


def _remember(mine: PerchLandingMemory, m: Any, now: float) -> None:
    """Put into the reference's memory what has changed; a number that is the same in float32 stays."""
    for name in _FLAGS:
        m[name] = getattr(mine, name)
    for name, tick in (*((f"{name}_time", getattr(mine, f"{name}_tick")) for name in _CLOCKS), _when(mine)):
        if tick != _tick(float(m[name])) or tick == _tick(now) != 0:
            m[name] = now if tick == _tick(now) else tick / 1000.0
    q, snapshot = mine.attitude, mine.snapshot
    _keep(m, "attitude", (q.x, q.y, q.z, q.w))
    _keep(m, "hold_position", _three(mine.hold_position))
    _keep(m, "hold_velocity", _three(mine.hold_velocity))
    _keep(m, "snapshot_velocity", _three(snapshot.velocity))
    for name in _CUES:
        _keep(m, f"snapshot_{name}", getattr(snapshot.cues, name))
    for name in _SNAPSHOT:
        _keep(m, f"snapshot_{name}", getattr(snapshot, name))


def _when(mine: PerchLandingMemory) -> tuple[str, int]:
    return "snapshot_time", mine.snapshot.tick


def _keep(m: Any, name: str, value: Any) -> None:
    if not np.array_equal(np.float32(m[name]), np.float32(value), equal_nan=True):
        m[name] = value
