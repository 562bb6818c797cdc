"""From a hold to the planner: who is followed until the planner knows where the drone is."""

from onboard.app_interface import LandingState
from sim_backend.crazyflie.engine import EngineEvent, Sample

HELD_ON_MS = 20
"""For which a hold that was handed over stays in force at most; the planner speaks every 10 ms."""


class HandOver:
    """Of one drone. What the planner said last is its old goal, perhaps metres away: nobody follows that."""

    def __init__(self) -> None:
        self._tick: int | None = None

    def holds_on(self, sample: Sample, state: LandingState, events: EngineEvent) -> bool:
        """Whether the hold is still in force, at a step with these `events` that ended in `state`."""
        if EngineEvent.HANDED_OVER in events:
            self._tick = sample.tick
        if self._tick is None:
            return False
        is_old = sample.set_at <= self._tick > sample.tick - HELD_ON_MS
        if not is_old or state is not LandingState.IDLE:
            self._tick = None
        return self._tick is not None
