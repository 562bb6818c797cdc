"""A tiny world for the supervisor: observations that follow its commands, with faults put in where wanted."""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from math import cos, sin

from mocap_bridge.health import PoseVerdict
from onboard.app_interface import EndReason, LandingState
from onboard.arrays import Quaternion
from onboard.jit import interpreted
from onboard.room import RoomGeometry
from onboard.supervisor_info import SupervisorBits, SupervisorInfo
from onboard.trajectory import fit_approach, sample_approach
from perchhw.supervisor import (
    CommandDone,
    Event,
    FlightState,
    Mission,
    Observation,
    Order,
    Phase,
    StopConfirmed,
    Tick,
    initial_state,
    step,
)
from perchhw.supervisor.events import (
    Arm,
    ArmApproach,
    Brake,
    Command,
    Disarm,
    DisarmPolicy,
    EmergencyStop,
    FlyCourse,
    GoTo,
    Land,
    StartApproach,
    TakeOff,
    UploadPolicy,
)

CRC = 0x1234ABCD
PLAN = fit_approach(2.5, 50.0, RoomGeometry())
MISSION = Mission(
    policy_crc=CRC,
    start=(PLAN.x0, PLAN.y0, PLAN.z0),
    hover_height=0.6,
    approach_duration=PLAN.impact_time,
    corridor=PLAN,
)
TEST_FLIGHT = replace(MISSION, policy_crc=0, test_flight=True, corridor=None)
PERIOD = 0.02
ANSWER_TIME = 0.5
"""s until the drone has accepted an approach."""
LEVEL, INVERTED = (0.0, 0.0, 0.0, 1.0), (0.0, 1.0, 0.0, 0.0)
TAU = 0.2
"""s before the ceiling at which the trigger fires, or the drone begins to brake."""
READY = SupervisorBits.CAN_ARM
FLYING = SupervisorBits.ARMED | SupervisorBits.CAN_FLY | SupervisorBits.FLYING

Fault = Callable[[Observation, float, FlightState], Observation]


def turned(*, tilt: float = 0.0, yaw: float = 0.0) -> Quaternion:
    """The attitude that is tilted by `tilt` about the body's y axis and turned to the heading `yaw` (rad)."""
    (a, b), (c, d) = ((sin(0.5 * angle), cos(0.5 * angle)) for angle in (tilt, yaw))
    return (-c * a, d * a, c * b, d * b)


def good_on_ground() -> Observation:
    """All is known and well, on the start mark."""
    return Observation(
        link_silence=0.01,
        pose_verdict=PoseVerdict.OK,
        pose_age=0.01,
        pose_position=(-3.0, 0.0, 0.07),
        pose_quaternion=LEVEL,
        estimate_age=0.01,
        estimate_position=(-3.0, 0.0, 0.07),
        estimate_velocity=(0.0, 0.0, 0.0),
        estimate_quaternion=LEVEL,
        drone=SupervisorInfo(READY),
        drone_age=0.01,
        battery_voltage=4.1,
        battery_age=0.05,
        landing_state=LandingState.IDLE,
        landing_age=0.01,
        active_policy_crc=0,
        policy_crc_age=0.01,
        rates_age=0.01,
        body_rates=(0.0, 0.0, 0.0),
        policy_armed=False,
        trajectory_armed=False,
        parameters_ok=True,
        trigger_count=0,
    )


@dataclass
class SimulatedAttempt:
    """Runs the supervisor against a drone that does at once what it is told.

    Attributes:
        mission: what is flown.
        fault: changes each observation before the supervisor sees it.
        triggers: whether the trigger fires half-way through the approach (otherwise the drone brakes).
        ends_by: why the drone says that it brakes.
        commands, orders: all so far.
        phases: all phases so far.
    """

    mission: Mission = MISSION
    fault: Fault = lambda observation, now, state: observation
    triggers: bool = True
    ends_by: EndReason | None = EndReason.MISSED_TRIGGER
    events_at: dict[Phase, Event] = field(default_factory=dict)
    commands: list[Command] = field(default_factory=list)
    orders: list[Order] = field(default_factory=list)
    phases: list[Phase] = field(default_factory=list)
    now: float = 0.0
    world: Observation = field(default_factory=good_on_ground)
    approach_armed: float | None = None
    approach_started: float | None = None
    course_ends: float | None = None
    course: Order | None = None

    def run(self, longest: float = 60.0) -> FlightState:
        """Until the supervisor is done; fails when it does not end within `longest` s."""
        state = initial_state(self.now)
        pending: list[Event] = []
        while state.phase is not Phase.DONE:
            if not self.phases or self.phases[-1] is not state.phase:
                self.phases.append(state.phase)
                if state.phase in self.events_at:
                    pending.append(self.events_at.pop(state.phase))
            if self.course_ends is not None and self.now > self.course_ends:
                self.course_ends = None
                assert self.course is not None
                pending.append(CommandDone(self.course))
            event = pending.pop(0) if pending else self._tick(state)
            state, orders = step(state, event, self.now, self.mission)
            for order in orders:
                self.commands.append(order.command)
                self._obey(order.command)
                match order.command:
                    case FlyCourse():
                        self.course = order
                    case EmergencyStop():
                        pending.append(StopConfirmed())
                    case UploadPolicy():
                        pending.append(CommandDone(order, CRC))
                    case _:
                        pending.append(CommandDone(order))
                self.orders.append(order)
            assert self.now < longest, f"stuck in {state.phase}, waiting for {state.waiting_for}"
        self.phases.append(state.phase)
        return state

    def _tick(self, state: FlightState) -> Tick:
        self.now += PERIOD
        if self.approach_armed is not None and self.now > self.approach_armed:
            self.approach_armed = None
            self._landing(LandingState.TRAJECTORY_ARMED)
        if self.approach_started is not None:
            self._fly_approach()
        return Tick(self.fault(self.world, self.now, state))

    def _fly_approach(self) -> None:
        since = self.now - (self.approach_started or 0.0)
        trigger = PLAN.impact_time - TAU
        if self.world.landing_state is LandingState.APPROACH:
            place, velocity, _ = interpreted(sample_approach)(PLAN, since)
            self._move(place)
            self.world = replace(self.world, estimate_velocity=velocity)
        if self.world.landing_state is LandingState.APPROACH and since > trigger:
            self._landing(LandingState.FLIP if self.triggers else LandingState.BRAKE)
            reason = EndReason.TRIGGERED if self.triggers else self.ends_by
            self.world = replace(self.world, end_reason=reason)
        elif self.world.landing_state is LandingState.FLIP and since > trigger + 0.2:
            self._landing(LandingState.CUT)
            self._move((PLAN.impact_x, PLAN.y0, PLAN.ceiling_z - 0.075))
            self.world = replace(self.world, pose_quaternion=INVERTED)
        elif self.world.landing_state is LandingState.BRAKE and since > trigger + 0.5:
            self._landing(LandingState.HOLD)

    def _landing(self, state: LandingState) -> None:
        self.world = replace(self.world, landing_state=state)

    def _move(self, position: tuple[float, float, float]) -> None:
        self.world = replace(self.world, pose_position=position, estimate_position=position)

    def _obey(self, command: Command) -> None:
        x, y, _ = self.world.pose_position or (0.0, 0.0, 0.0)
        match command:
            case UploadPolicy():
                self.world = replace(self.world, active_policy_crc=CRC)
            case Arm():
                self.world = replace(self.world, drone=SupervisorInfo(FLYING))
            case TakeOff(height, _):
                self._move((x, y, height))
            case GoTo(position, _):
                self._move(position)
            case ArmApproach():
                self.world = replace(self.world, policy_armed=True, trajectory_armed=True)
                self.approach_armed = self.now + ANSWER_TIME
            case StartApproach():
                self._landing(LandingState.APPROACH)
                self.approach_started = self.now
            case FlyCourse():
                self.course_ends = self.now + self.mission.approach_duration
            case Brake():
                self._landing(LandingState.HOLD)
                self.world = replace(self.world, policy_armed=False)
            case DisarmPolicy():
                self.world = replace(self.world, policy_armed=False)
            case Land(_):
                self._landing(LandingState.IDLE)
                self.world = replace(self.world, policy_armed=False, trajectory_armed=False)
                self.world = replace(self.world, estimate_velocity=(0.0, 0.0, 0.0))
                self.approach_started = None
                self._move((x, y, 0.07))
            case Disarm():
                self.world = replace(self.world, drone=SupervisorInfo(READY))
            case EmergencyStop():
                self.world = replace(self.world, drone=SupervisorInfo(SupervisorBits.LOCKED))
