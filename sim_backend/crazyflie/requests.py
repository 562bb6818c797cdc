"""What a write of ``perch.trjArm`` asks of the control loop, by the reference: ``core/requests.c``."""

import math
from dataclasses import dataclass

from onboard.trajectory import ApproachPlan, plan_from_velocity
from sim_backend.crazyflie.engine import ApproachRequest

NO_PLAN = ApproachPlan(*[math.nan] * 12)
"""Which nothing accepts."""


@dataclass(frozen=True, slots=True)
class Request:
    """One write."""

    number: int
    armed: bool
    plan: ApproachPlan


def planned(approach: ApproachRequest) -> ApproachPlan:
    """The plan of an approach; `NO_PLAN` where its numbers make none."""
    if not (approach.ax > 0.0 and approach.az > 0.0):
        return NO_PLAN
    return plan_from_velocity(*approach)
