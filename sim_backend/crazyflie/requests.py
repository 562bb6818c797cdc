"""What the parameter task asks of the control loop, by the reference: ``core/requests.c``."""

import math
from dataclasses import dataclass

from onboard.app_interface import LandingState, TrajectoryStatus
from onboard.trajectory import ApproachPlan, plan_from_velocity
from sim_backend.crazyflie.engine import ApproachRequest, Event

NO_PLAN = ApproachPlan(*[math.nan] * 12)
"""Which nothing accepts."""


@dataclass(frozen=True, slots=True)
class Request:
    """One write of ``perch.trjArm``."""

    number: int
    armed: bool
    plan: ApproachPlan


def planned(approach: ApproachRequest) -> ApproachPlan:
    """The plan of an approach; `NO_PLAN` where its numbers make none."""
    if not (approach.ax > 0.0 and approach.az > 0.0):
        return NO_PLAN
    return plan_from_velocity(*approach)


class Posted:
    """What one task posts and the other takes at its next step: requests, switches and flags.

    Attributes:
        plan: of the approach that is armed, or was last.
        trajectory_armed, policy_armed: the switches, as the landing machine is to see them.
        go, abort: flags, each for one step.
        status: the answer to the last request; NONE while it waits.
    """

    def __init__(self) -> None:
        self.plan = NO_PLAN
        self.trajectory_armed = self.policy_armed = self.go = self.abort = False
        self.status = TrajectoryStatus.NONE
        self._request = Request(0, False, NO_PLAN)
        self._consumed = 0

    def post(self, armed: bool, approach: ApproachRequest) -> int:
        """Post a request; its number."""
        self._request = Request(self._request.number + 1, armed, planned(approach))
        self.status = TrajectoryStatus.NONE
        return self._request.number

    def is_consumed(self, number: int) -> bool:
        """Whether request `number` was the last that was taken."""
        return self._consumed == number

    def to_be_armed(self, state: LandingState) -> ApproachPlan | None:
        """The plan that a machine in `state` is about to arm."""
        arms = self._waits and self._request.armed and state is LandingState.IDLE
        return self._request.plan if arms else None

    def take(self, state: LandingState, arm_seen: bool) -> None:
        """Consume what waits, once a machine in `state` has seen the switch as the last request left it.

        An armed approach does not change: another plan first disarms, and is armed in the step after.
        """
        request = self._request
        if not self._waits or self.trajectory_armed != arm_seen:
            return
        if request.armed and state is LandingState.TRAJECTORY_ARMED and request.plan != self.plan:
            self.trajectory_armed = False
            return
        self._consumed = request.number
        self.trajectory_armed = request.armed
        if request.armed and state is LandingState.IDLE:
            self.plan = request.plan

    def clear_flags(self, go_taken: bool) -> Event:
        """The machine has seen the flags, `go` where it was not the one before again."""
        events = Event.NONE
        if go_taken:
            self.go = False
            events |= Event.GO_TAKEN
        if self.abort:
            self.abort = False
            events |= Event.ABORT_TAKEN
        return events

    def answer(self, status: TrajectoryStatus) -> Event:
        """What the machine makes of the last request, unless one is still to be consumed."""
        if self._waits:
            return Event.NONE
        self.status = status
        if status >= TrajectoryStatus.REFUSED_TOO_FAR and self.trajectory_armed:
            self.trajectory_armed = False
            return Event.REFUSED
        return Event.NONE

    def withdraw(self) -> None:
        """Nothing waits, and nothing is on."""
        self.status = TrajectoryStatus.NONE
        self._consumed = self._request.number
        self.trajectory_armed = self.policy_armed = self.go = self.abort = False

    @property
    def _waits(self) -> bool:
        return self._request.number != self._consumed
