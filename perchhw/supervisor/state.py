"""The supervisor's types: where an attempt stands, what is to be flown, and by when."""

from dataclasses import dataclass, field
from enum import StrEnum
from math import inf
from typing import NamedTuple

from onboard.arrays import Vector
from onboard.trajectory import ApproachPlan
from perchhw.supervisor.events import Order
from perchhw.supervisor.gate import GateMemory
from perchhw.supervisor.limits import SafetyLimits


class Phase(StrEnum):
    """Where the attempt stands."""

    CHECKING = "checking"
    UPLOADING = "uploading"
    READY = "ready"
    ARMING = "arming"
    TAKING_OFF = "taking off"
    MOVING_TO_START = "moving to start"
    ARMING_APPROACH = "arming approach"
    APPROACHING = "approaching"
    TEST_FLIGHT = "test flight"
    FLIPPING = "flipping"
    SETTLING = "settling"
    BRAKING = "braking"
    LANDING = "landing"
    DISARMING = "disarming"
    STOPPING = "stopping"
    DONE = "done"


IN_FLIGHT = frozenset(
    {
        Phase.TAKING_OFF,
        Phase.MOVING_TO_START,
        Phase.ARMING_APPROACH,
        Phase.TEST_FLIGHT,
        Phase.APPROACHING,
        Phase.BRAKING,
        Phase.LANDING,
    }
)
"""Phases in which the motors turn and the drone flies upright."""


@dataclass(frozen=True, kw_only=True)
class Mission:
    """What is to be flown.

    Attributes:
        policy_crc: CRC32 of the bundle that must be live on the drone; a test flight needs none.
        start: where the approach or the course begins, m, world frame.
        hover_height: height of the first hover, m.
        approach_duration: from the start of the approach to the ceiling if nothing were done, or of the
            course of a test flight, s.
        dry_run: stop after the verified upload (the checks, without a policy); the motors never arm.
        test_flight: fly a course and land upright, without any policy.
        transit_speed: mean speed of moves between hovers, m/s.
        arm_at: earliest time at which the motors are armed, s of the injected clock.
        corridor: the planned approach, about which position, speed and attitude must stay up to the trigger;
            ``None`` for a test flight.
    """

    policy_crc: int
    start: Vector
    hover_height: float
    approach_duration: float
    dry_run: bool = False
    test_flight: bool = False
    transit_speed: float = 0.8
    arm_at: float = -inf
    corridor: ApproachPlan | None = None


@dataclass(frozen=True, kw_only=True)
class Timing:
    """Deadlines and dwell times of the phases, s.

    Attributes:
        land: for a descent from wherever the drone is; from under the ceiling that is 0.6 m/s.
        arm_hold: between "may fly" and the take-off. The firmware's planner learns where the drone is up to
            10 ms after it may fly; an earlier take-off would start from the origin.
        stop_hold: how long a rule of the descent must be broken until the motors are cut: longer than a
            lost packet, a swing or a tick about which nothing is known. A brake whose state is unknown for
            as long is landed.
        hang_hold: how long a landed drone must look as if it did not hold until the operator is told; a body
            that is caught hangs within 0.22 s of the cut, one that falls is 0.4 m lower after 0.3.
        switches_deadline: for approach and policy to be read back as off once the landing was ordered.
        bits_delay: oldest age that the drone's bits have when they are sent (it renews them at 25 Hz).
        watchdog_margin: how long after the last kick the drone's own watchdog (1 s) surely leaves it alone: a
            lock that is seen earlier is somebody's stop.
        stop_deadline: for the stop path to report: it gives up after 3 s of silence or 5 s in all
            (``onboard.link.stop``), so that what takes longer than both has died without a word.
        disarm_hold: for the bits to say "not armed" without a break, so that an arming that was still under
            way is seen.
    """

    checks_hold: float = 0.5
    checks_deadline: float = 8.0
    upload_deadline: float = 20.0
    ready_deadline: float = 10.0
    arm_deadline: float = 3.0
    arm_hold: float = 0.1
    take_off: float = 2.0
    move_margin: float = 4.0
    hover_hold: float = 0.6
    approach_arm_deadline: float = 2.0
    approach_margin: float = 1.0
    course_margin: float = 2.0
    flip_deadline: float = 1.0
    settle: float = 2.5
    brake_deadline: float = 3.0
    land: float = 3.5
    land_margin: float = 3.0
    stop_hold: float = 0.3
    hang_hold: float = 0.3
    switches_deadline: float = 1.0
    bits_delay: float = 0.05
    watchdog_margin: float = 0.5
    disarm_hold: float = 0.2
    disarm_deadline: float = 2.0
    stop_deadline: float = 8.0


@dataclass(frozen=True, kw_only=True)
class FlightState:
    """The supervisor's memory.

    Attributes:
        phase: where the attempt stands.
        entered_at: when it came there, s of the injected clock.
        time: of the last event, s; never runs back.
        clock_shift: s to add to the clock, which was set back by as much.
        gate: what the gate carries from tick to tick.
        good_since: since when the phase's condition holds without a break, s, or ``None``.
        bad_since: since when what the phase forbids goes on without a break, s, or ``None``.
        orders_given: number of the last order, 0 before the first.
        oldest_in_force: number of the oldest order still in force: older ones are dropped where they wait,
            and answers to them are ignored.
        answered_at: when the order of the present phase was reported as carried out, s, or ``None``.
        arm_ordered: the drone was asked to arm, so its motors may turn.
        armed: the motors were armed in this attempt.
        airborne_since: when the take-off was ordered, s, or ``None``.
        approach_ordered: the drone was asked to arm approach and policy.
        approach_began: when the drone was first seen on its approach, s, or ``None``.
        flip_height: height at which the drone was last seen before its trigger, m, or ``None``.
        triggered: the drone's own trigger fired.
        triggers_before: triggers that the drone had counted when the approach began.
        aborted_by: the rule, command or person that ended the attempt early, or ``None``.
        link_lost: why the link broke, or ``None``; after the flip that is no abort, but less is recorded.
        locked: the drone's own supervisor locked it, or cut the motors in flight, and not for us: somebody
            has stopped it.
        stop_unconfirmed: why nobody knows whether the motors have stopped, or ``None``.
        fell: how the motors came to be cut before the drone was down, without a trigger, or ``None``.
        record_lost: why the record may be incomplete, or ``None``.
        alert: what the operator must be told at once and loudly, or ``None``.
        alert_due_since: since when something else was to be told without a break, s, or ``None``.
        waiting_for: what the current phase waits for, in words.
    """

    phase: Phase
    entered_at: float
    time: float = -inf
    clock_shift: float = 0.0
    gate: GateMemory = field(default_factory=GateMemory)
    good_since: float | None = None
    bad_since: float | None = None
    orders_given: int = 0
    oldest_in_force: int = 1
    answered_at: float | None = None
    arm_ordered: bool = False
    armed: bool = False
    airborne_since: float | None = None
    approach_ordered: bool = False
    approach_began: float | None = None
    flip_height: float | None = None
    triggered: bool = False
    triggers_before: int = 0
    aborted_by: str | None = None
    link_lost: str | None = None
    locked: bool = False
    stop_unconfirmed: str | None = None
    fell: str | None = None
    record_lost: str | None = None
    alert: str | None = None
    alert_due_since: float | None = None
    waiting_for: str = ""


class Step(NamedTuple):
    """Result of one step: the next state and the orders to carry out, in order."""

    state: FlightState
    orders: tuple[Order, ...] = ()


@dataclass(frozen=True)
class Context:
    """What every phase function gets besides the state."""

    now: float
    mission: Mission
    limits: SafetyLimits
    timing: Timing
