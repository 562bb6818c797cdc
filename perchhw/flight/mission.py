"""From a commanded speed and angle to what is flown: approach, start point and hover height, or why not."""

from dataclasses import dataclass

from onboard.errors import InputError
from onboard.lab_file import room_problem
from onboard.trajectory import ApproachPlan, fit_approach, plan_approach, start_outside
from perchhw.attempt import APPROACH_PARAMETERS, SHAPE, AttemptRequest
from perchhw.errors import FlightStackError
from perchhw.supervisor import Mission

LOWEST_HOVER = 0.5
"""Height of the first hover, m, unless the approach starts higher."""

START_MARGIN = 0.2
"""Distance of the start from the side walls, m."""


class ApproachNotPossible(FlightStackError, InputError):
    """The commanded approach does not fit the room, or its parameters are unknown."""


@dataclass(frozen=True, kw_only=True)
class AttemptPlan:
    """Everything that is decided before an attempt.

    Attributes:
        approach: the trajectory that the drone flies.
        mission: what the supervisor works towards.
    """

    approach: ApproachPlan
    mission: Mission


def plan_attempt(request: AttemptRequest, policy_crc: int, dry_run: bool = False) -> AttemptPlan:
    """Plan one attempt.

    Accelerations (``ax``, ``az``, m/s2) and the time at constant velocity (``tau0``, s) are as near to the
    authors' as fit the room, unless the request fixes all three of them; ``impact_x`` and ``impact_y`` (m)
    move the point that the approach aims at.

    Raises:
        ApproachNotPossible: a room that nothing flies in, unknown or incomplete parameters, or a start
            outside the room.
        ApproachError: no approach fits; the message says what to change.
    """
    unusable = room_problem(request.room)
    if unusable is not None:
        raise ApproachNotPossible(f"room: {unusable}")
    approach = _approach(request)
    start = (float(approach.x0), float(approach.y0), float(approach.z0))
    outside = start_outside(approach, request.room, request.room.floor_z, START_MARGIN)
    if outside is not None:
        raise ApproachNotPossible(
            f"the approach would start at {outside}; choose a larger approach.ax, or another impact point"
        )
    mission = Mission(
        policy_crc=policy_crc,
        start=start,
        hover_height=max(LOWEST_HOVER, start[2]),
        approach_duration=float(approach.impact_time),
        dry_run=dry_run,
        corridor=approach,
    )
    return AttemptPlan(approach=approach, mission=mission)


def _approach(request: AttemptRequest) -> ApproachPlan:
    given = dict(request.approach)
    unknown = given.keys() - set(APPROACH_PARAMETERS)
    if unknown:
        raise ApproachNotPossible(
            f"approach parameter {', '.join(sorted(unknown))} is unknown; "
            f"known are {', '.join(APPROACH_PARAMETERS)}"
        )
    impact_x, impact_y = given.pop("impact_x", 0.0), given.pop("impact_y", 0.0)
    if not given:
        return fit_approach(
            request.speed, request.angle_deg, request.room, impact_x=impact_x, impact_y=impact_y
        )
    missing = set(SHAPE) - given.keys()
    if missing:
        raise ApproachNotPossible(
            f"approach gives {', '.join(sorted(given))} but not {', '.join(sorted(missing))}: "
            "give all three or none"
        )
    ceiling = request.room.ceiling_at(impact_x, impact_y)
    return plan_approach(request.speed, request.angle_deg, impact_x, ceiling, **given, impact_y=impact_y)
