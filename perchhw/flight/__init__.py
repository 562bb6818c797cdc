"""One supervised attempt: link, mocap, supervisor and recorder put together.

:func:`fly_attempt` is the one way to fly, for the simulation and for hardware: only the URIs differ.
"""

from perchhw.flight.attempt import check_attempt, fly_attempt
from perchhw.flight.mission import AttemptPlan, plan_attempt

__all__ = ["AttemptPlan", "check_attempt", "fly_attempt", "plan_attempt"]
