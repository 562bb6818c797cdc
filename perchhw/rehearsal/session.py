"""One rehearsal over the link: switch it on, fly the approach in the drone's head, read what it recorded."""

import math
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, nullcontext
from dataclasses import dataclass
from enum import StrEnum
from typing import TYPE_CHECKING

from onboard.app_interface import EndReason, LandingState, Log, Parameter, Rehearsal
from onboard.errors import SafetyStop
from onboard.firmware.constants import vehicle_crc32
from onboard.lab_time import open_timebase
from onboard.landing.model import landing_limits
from onboard.link.exclusive import hold
from onboard.link.landing_app import arm_approach, check_vehicle, engine_of, poll
from onboard.link.power import refuse_flying
from onboard.link.recorder import read_ring
from onboard.policy.bundle import encode_bundle
from onboard.policy.model import Policy
from onboard.ring import Ring
from onboard.timebase import Timebase
from onboard.trajectory import ApproachPlan
from onboard.vehicle import Vehicle
from perchhw.errors import FlightStackError
from perchhw.rehearsal.loop_time import LoopTime, LoopWatch
from perchhw.rehearsal.physics import Physics
from perchhw.rehearsal.poses import ApproachPoses
from perchhw.rehearsal.verdict import RehearsalVerdict, judge
from perchhw.rehearsal.watched import CUES, OpenRecord, RehearsalRecord

if TYPE_CHECKING:
    from onboard.link import DroneLink, LogSample

SETTLED_M, SETTLED_M_S = 0.05, 0.1
"""How near the approach's start, and how still, the drone believes to be before the approach is armed."""
SETTLE_TIMEOUT_S = 10.0
IDLE_TIMEOUT_S = 0.5
"""The control loop takes the end of a rehearsal in its next step."""
FLIP_TIMEOUT_S = 1.0
"""The flip of a drone that does not turn is cut after 0.5 s."""

_RESET = "kalman.resetEstimation"
_STATES: dict[Physics, tuple[str, ...]] = {
    Physics.HOST: tuple(f"stateEstimate.{name}" for name in ("x", "y", "z", "vx", "vy", "vz")),
    Physics.DRONE: (Log.MODEL_X, Log.MODEL_Y, Log.MODEL_Z, Log.MODEL_VX, Log.MODEL_VY, Log.MODEL_VZ),
}
"""Where the drone believes to be: position, velocity."""
_MODES = {Physics.HOST: Rehearsal.POSES, Physics.DRONE: Rehearsal.MODEL}
_ENDED = frozenset(LandingState) - {LandingState.IDLE, LandingState.TRAJECTORY_ARMED, LandingState.APPROACH}


class RehearsalStage(StrEnum):
    """What a rehearsal does, in its order."""

    CONNECTING = "connecting"
    UPLOADING = "uploading"
    BELIEVING = "believing"
    APPROACHING = "approaching"
    READING = "reading"


OnStage = Callable[[RehearsalStage, str], object]
"""Told which stage begins, and what it waits for in words."""


class RehearsalRefused(FlightStackError, SafetyStop):
    """The drone does not rehearse now; nothing was armed."""


class RehearsalFailed(FlightStackError):
    """The rehearsal came to no end that could be judged."""


@dataclass(frozen=True)
class Rehearsed:
    """What came of a rehearsal.

    Attributes:
        physics: where it was flown.
        engine: the code that computed on the drone, ``c`` or ``reference``.
        policy_crc32: of the policy, as the drone reads it back.
        ring: what the drone recorded.
        verdict: what is to be said about it.
        loop: how long the drone's loop took meanwhile; None of a drone without a processor.
    """

    physics: Physics
    engine: str | None
    policy_crc32: int
    ring: Ring
    verdict: RehearsalVerdict
    loop: LoopTime | None = None


def rehearse(
    drone: str,
    plan: ApproachPlan,
    policy: Policy,
    vehicle: Vehicle,
    open_record: OpenRecord | None = None,
    on_stage: OnStage = lambda _stage, _waits_for: None,
    physics: Physics = Physics.HOST,
) -> Rehearsed:
    """Rehearse an approach on the drone at `drone` (URI), whose firmware was built for `vehicle`.

    Args:
        drone, plan, policy, vehicle: what is rehearsed.
        open_record: opens a record of it, for a view that follows; the drone then sends its cues too.
        on_stage: told what begins.
        physics: where the approach is flown.

    Raises:
        RehearsalRefused, DroneIsFlying: the drone is armed, flies, or a motor turns.
        RehearsalFailed: no end of the approach.
        CommandRefused: the firmware was built for another vehicle, or refuses approach or policy.
        LinkError: the link failed, or the firmware is not ours.
    """
    from onboard.link import DroneLink

    with hold(drone), open_timebase("rehearse", drone) as time:
        on_stage(RehearsalStage.CONNECTING, "the drone to answer")
        refuse_flying(drone, time)
        with DroneLink.open(drone, clock=time) as link:
            check_vehicle(link, vehicle_crc32(vehicle), vehicle.name)
            engine = engine_of(link)
            on_stage(RehearsalStage.UPLOADING, "the policy to be read back")
            crc = link.upload_policy(encode_bundle(policy))
            _await_slot(time)
            _end_abandoned(link, time)
            with _rehearsing(link, physics), open_record(time) if open_record else nullcontext() as record:
                told, watch = _Drone(link, physics, record), LoopWatch(link)
                ring = _fly(link, told, plan, landing_limits(vehicle).smoothing, physics, time, on_stage)
    verdict = judge(ring, told.reason, plan, policy, vehicle)
    return Rehearsed(physics, engine, crc, ring, verdict, watch.summary())


def _end_abandoned(link: "DroneLink", time: Timebase) -> None:
    """End a rehearsal whose host died: its machine would still be in the approach that nobody ended."""
    if link.param(Parameter.REHEARSE) != Rehearsal.OFF:
        link.set_param(Parameter.REHEARSE, Rehearsal.OFF)
        idle = LandingState.IDLE
        poll(lambda: link.param(Parameter.STATE), lambda state: state == idle, time, IDLE_TIMEOUT_S)


@contextmanager
def _rehearsing(link: "DroneLink", physics: Physics) -> Iterator[None]:
    """The mode, until the end of the block; then the drone forgets where poses said that it was."""
    mode = _MODES[physics]
    try:
        link.set_param(Parameter.REHEARSE, mode)
        if link.param(Parameter.REHEARSE) != mode:
            raise RehearsalRefused(
                "the drone does not rehearse: it must be disarmed, on the ground, with all motors still, "
                "its landing app idle and its firmware configured as the app needs it; disarm it, or reboot "
                "it, and see what perchhw doctor says"
            )
        if physics is Physics.HOST:
            link.set_param(_RESET, 1)
        yield
    finally:
        link.set_param(Parameter.REHEARSE, Rehearsal.OFF)
        still_on = link.param(Parameter.REHEARSE) != Rehearsal.OFF
    if still_on:
        raise RehearsalFailed("the drone still rehearses, though it was told to end it: reboot it")
    if physics is Physics.HOST:
        link.set_param(_RESET, 1)


class _Drone:
    """What the drone said last."""

    def __init__(self, link: "DroneLink", physics: Physics, record: RehearsalRecord | None) -> None:
        self.record = record
        self._names = _STATES[physics]
        self.state, self.reason = LandingState.IDLE, EndReason.NONE
        self._estimate: tuple[float, ...] = (math.nan,) * 6
        link.stream((*self._names, Log.STATE, Log.REASON), 10, self._take)
        if record is not None:
            link.stream(tuple(CUES), 10, record.take_cues)

    def _take(self, sample: "LogSample") -> None:
        values = sample.values
        self._estimate = tuple(values[name] for name in self._names)
        self.state, self.reason = LandingState(int(values[Log.STATE])), EndReason(int(values[Log.REASON]))
        if self.record is not None:
            self.record.take_state(self._estimate, self.state)

    def is_at_start(self, plan: ApproachPlan) -> bool:
        """Whether it believes to stand still where the approach begins."""
        near = math.dist(self._estimate[:3], (plan.x0, plan.y0, plan.z0)) <= SETTLED_M
        return near and math.hypot(*self._estimate[3:]) <= SETTLED_M_S


def _fly(
    link: "DroneLink",
    told: _Drone,
    plan: ApproachPlan,
    smoothing: float,
    physics: Physics,
    time: Timebase,
    on_stage: OnStage,
) -> Ring:
    """The approach from its arming to what was recorded."""
    with ExitStack() as until_read:
        poses = None
        if physics is Physics.HOST:
            on_pose = None if told.record is None else told.record.take_pose
            poses = until_read.enter_context(ApproachPoses(link, plan, smoothing, time, on_pose))
            _await_belief(told, plan, time, on_stage)
        _await_slot(time)  # the instant of belief depends on which thread looked first
        on_stage(RehearsalStage.APPROACHING, f"the flip, at most {plan.impact_time:.1f} s")
        arm_approach(link, plan, time)
        link.set_param(Parameter.GO, 1)
        if poses is not None:
            poses.go()
        within = plan.impact_time + 2.0 * smoothing + FLIP_TIMEOUT_S
        state = poll(lambda: told.state, lambda state: state in _ENDED, time, within)
        if state not in _ENDED:
            _check_still_on(link)
            raise RehearsalFailed(f"the drone's approach did not end within {within:.1f} s: {state.name}")
        on_stage(RehearsalStage.READING, "what the drone recorded")
        ring = read_ring(link, time)
    _check_still_on(link)
    return ring


def _await_belief(told: _Drone, plan: ApproachPlan, time: Timebase, on_stage: OnStage) -> None:
    """Until the drone believes the poses of the approach's start."""
    on_stage(RehearsalStage.BELIEVING, "the drone to believe its poses")
    if not poll(lambda: told.is_at_start(plan), bool, time, SETTLE_TIMEOUT_S):
        raise RehearsalFailed(
            f"the drone does not believe within {SETTLE_TIMEOUT_S:g} s the poses that it is sent; "
            "does somebody else send it poses, or does it lie tilted?"
        )


def _await_slot(time: Timebase) -> None:
    """In a lab: go on at a time that hangs on no machine's speed."""
    time.event().wait(max(0.0, time.slot() - time()))


def _check_still_on(link: "DroneLink") -> None:
    if link.param(Parameter.REHEARSE) == Rehearsal.OFF:
        raise RehearsalRefused("the drone ended the rehearsal: a motor had a thrust, or it was flown")
