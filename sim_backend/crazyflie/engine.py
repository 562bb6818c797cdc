"""The one door between the simulated firmware and what the drone computes, in C or as the reference.

An engine has everything between the estimate and the motors: policy, landing machine, control law, mixer,
battery compensation. The simulated firmware gives it one sample a ms and, from its parameter task, requests,
flags and staged bundles; what comes out are motor ratios, and what there is to say.
"""

from collections.abc import Sequence
from enum import IntEnum, IntFlag
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from onboard.app_interface import EndReason, LandingState, PolicyStatus, Rehearsal, TrajectoryStatus
from onboard.arrays import FloatArray, Vector
from onboard.controller import Wrench
from onboard.landing.model import OutputMode
from onboard.mixer import Thrusts
from sim_backend.crazyflie.estimator import Estimator
from sim_backend.crazyflie.setpoint import Setpoint


class EngineEvent(IntFlag):
    """What happened in a step."""

    NONE = 0
    GO_TAKEN = 1
    ABORT_TAKEN = 2
    REFUSED = 4
    """Arming was refused: the switch is off again."""
    HANDED_OVER = 8
    """The planner shall stay where the drone is."""
    CUT = 16
    """The motors were cut: the planner's plan shall be dropped."""
    REHEARSAL_ENDED = 32
    """All switches are off again."""


class Sample(NamedTuple):
    """What the control loop has in one ms.

    Attributes:
        tick: ms since boot.
        estimator: the filter, for its state.
        gyro: rad/s, body, (3,).
        setpoint: after the supervisor's say.
        set_at: ms since boot at which it was set.
        pose_age: ms since the last external pose; None: there was none.
        voltage: of the battery, as measured, V.
        flying: what the supervisor says.
        levelling: whether the supervisor replaced the setpoint.
        thrust_seen: whether a motor had a thrust in the ms before, whoever gave it.
    """

    tick: int
    estimator: Estimator
    gyro: FloatArray
    setpoint: Setpoint
    set_at: int
    pose_age: int | None
    voltage: float
    flying: bool
    levelling: bool
    thrust_seen: bool = False


class ApproachRequest(NamedTuple):
    """Arguments of :func:`onboard.trajectory.plan_from_velocity`, as parameters say now: m/s, m, m/s2, s."""

    vx: float
    vz: float
    impact_x: float
    impact_y: float
    ceiling_z: float
    ax: float
    az: float
    tau0: float


class SnapshotField(IntEnum):
    """Numbers of the sample that triggered the last flip: s, 1/s, m, N m, m/s, rad (positive nose down)."""

    TAU = 0
    THETA_X = 1
    D_CEIL = 2
    TRIGGER_VALUE = 3
    A_ROT = 4
    VX = 5
    VY = 6
    VZ = 7
    Z = 8
    PITCH = 9


class Engine(Protocol):
    """What a drone computes. The attributes are those of the last step."""

    ratios: NDArray[np.int64]
    """(4,), 0..65535: what the motors are to get."""

    @property
    def mean_ratios(self) -> Sequence[int]:
        """(4,), 0..65535: `ratios`, averaged over the last 10 ms."""
        ...

    @property
    def thrusts(self) -> Thrusts:
        """N, M1 to M4."""
        ...

    @property
    def wrench(self) -> Wrench:
        """N and N m, as the mixer got it."""
        ...

    @property
    def mode(self) -> OutputMode:
        """What the landing machine does; PASS: it does not fly."""
        ...

    @property
    def target(self) -> Setpoint:
        """What is tracked in mode SETPOINT."""
        ...

    @property
    def state(self) -> LandingState:
        """Of the landing machine."""
        ...

    @property
    def reason(self) -> EndReason:
        """Why the last approach ended."""
        ...

    @property
    def trajectory_status(self) -> TrajectoryStatus:
        """The answer to the last request; NONE while it waits."""
        ...

    @property
    def cues(self) -> Vector:
        """tau (s), theta_x (rad/s), d_ceil (m) of the last evaluation."""
        ...

    @property
    def trigger_value(self) -> float:
        """Of the last evaluation; 0 without a policy."""
        ...

    @property
    def a_rot(self) -> float:
        """Of the last evaluation, N m; 0 without a policy."""
        ...

    @property
    def snapshot_tick(self) -> int:
        """When the last flip was triggered, ms."""
        ...

    @property
    def snapshot_count(self) -> int:
        """Flips so far."""
        ...

    def snapshot(self, field: SnapshotField) -> float:
        """One number of the sample that triggered the last flip."""
        ...

    @property
    def has_policy(self) -> bool:
        """Whether a policy is live."""
        ...

    @property
    def live_crc(self) -> int:
        """CRC-32 of the live policy's bundle; 0 for none."""
        ...

    def boot(self) -> None:
        """Start anew: no policy, nothing armed."""
        ...

    def commit(self, staged: bytes, crc: int, flying: bool) -> PolicyStatus:
        """Make a staged bundle the live policy; a refusal keeps the one that is live."""
        ...

    def arm_policy(self, on: bool) -> bool:
        """Arm or disarm the policy; says whether it is armed now."""
        ...

    def post(self, armed: bool, approach: ApproachRequest) -> int:
        """Post a request for the next step; its number."""
        ...

    def is_consumed(self, number: int) -> bool:
        """Whether request `number` was the last that was taken."""
        ...

    def ask_go(self, on: bool) -> None:
        """Set the flag `go`; it counts once."""
        ...

    def ask_abort(self, on: bool) -> None:
        """Set the flag `abort`; it counts once."""
        ...

    def rehearse(self, wanted: int, at_rest: bool) -> Rehearsal:
        """Begin or end a rehearsal; says which is on now.

        `wanted`: a :class:`~onboard.app_interface.Rehearsal`; any other number ends it.

        `at_rest`: the supervisor is neither armed nor flying, and no motor has a thrust.
        """
        ...

    @property
    def rehearses(self) -> bool:
        """Whether a rehearsal is on."""
        ...

    @property
    def model(self) -> tuple[Vector, Vector]:
        """Position (m) and velocity (m/s) of the model that flew in the last rehearsal on it."""
        ...

    def record(self) -> bytes:
        """The recorder as the ground reads it (:mod:`onboard.ring`)."""
        ...

    def set_ceiling(self, ceiling_z: float) -> None:
        """Height (m) of the ceiling for the cues while nothing is armed."""
        ...

    def step(self, sample: Sample) -> EngineEvent:
        """One ms."""
        ...
