"""Rules while the drone brakes and lands after a flight. What breaks them for long is stopped in the air.

Stopping lets the drone fall, so these rules are wide: a landing that still works, blind or with a doubtful
estimate, is better than a fall. They speak when the drone no longer hears, no longer knows where it is, or
leaves the room.
"""

from math import degrees, hypot

from perchhw.supervisor.limits import SafetyLimits
from perchhw.supervisor.observation import Admitted
from perchhw.supervisor.violation import Rule, Violation, at_most


def heard_in_descent(o: Admitted, limits: SafetyLimits) -> Violation | None:
    """The drone, and its supervisor, spoke not long ago."""
    return at_most("link_silence", o.link_silence, limits.descent_silence, "s") or at_most(
        "drone_state_age", o.drone_age, limits.descent_silence, "s"
    )


def _only_late(o: Admitted, limits: SafetyLimits) -> bool:
    """The estimate is not here, but was not long ago: the drone has it still, and lands by it."""
    return o.estimate_age is not None and limits.telemetry_age < o.estimate_age <= limits.descent_silence


def estimate_believable(o: Admitted, limits: SafetyLimits) -> Violation | None:
    """The estimate by which the drone lands is known, and near what mocap sees."""
    if _only_late(o, limits):
        return None
    if o.estimate_position is None or o.estimate_velocity is None:
        return Violation("descent_estimate", "unknown", "known")
    if o.pose_position is None:
        return None
    return at_most("descent_disagreement", o.estimate_to_pose, limits.descent_disagreement, "m")


def _not_faster_than(limit: float, o: Admitted, limits: SafetyLimits) -> Violation | None:
    """Without poses it is rather the estimate that runs away; the rule then has another name."""
    if _only_late(o, limits):
        return None
    speed = None if o.estimate_velocity is None else hypot(*o.estimate_velocity)
    if o.pose_position is None:
        return at_most("descent_speed_blind", speed, limit, "m/s")
    return at_most("descent_speed", speed, limit, "m/s")


def slow_in_descent(o: Admitted, limits: SafetyLimits) -> Violation | None:
    """The drone is not faster than what brakes from an approach."""
    return _not_faster_than(limits.descent_speed, o, limits)


def slow_after_course(o: Admitted, limits: SafetyLimits) -> Violation | None:
    """The drone is not faster than what lands from a course that was broken off."""
    return _not_faster_than(limits.descent_speed_after_course, o, limits)


def steady_in_descent(o: Admitted, limits: SafetyLimits) -> Violation | None:
    """The drone does not spin. A fast tumble comes by upright again and again, which the tilt forgives.

    Rates that do not arrive say nothing, and end no landing: the tilt must be known all the same.
    """
    if o.rates_age is None or o.rates_age > limits.telemetry_age:
        return None
    rotation = None if o.body_rates is None else hypot(*o.body_rates)
    return at_most("descent_rotation", rotation, limits.descent_rotation, "rad/s")


def upright_in_descent(o: Admitted, limits: SafetyLimits) -> Violation | None:
    """The drone does not tumble."""
    if _only_late(o, limits):
        return None
    attitude = o.estimate_attitude
    tilt = None if attitude is None else degrees(attitude.tilt)
    return at_most("descent_tilt", tilt, degrees(limits.descent_tilt), "deg")


def inside_walls_in_descent(o: Admitted, limits: SafetyLimits) -> Violation | None:
    """The drone has not left the room through a wall; mocap is asked first, then the estimate."""
    place = o.pose_position or o.estimate_position
    if place is None and _only_late(o, limits):
        return None
    if place is None:
        return Violation("descent_place", "unknown", "known")
    (x, y, _), room = place, limits.room
    beyond = max(room.x_min - x, x - room.x_max, room.y_min - y, y - room.y_max)
    return at_most("descent_beyond_walls", beyond, limits.descent_escape, "m")


_ANY_DESCENT: tuple[Rule, ...] = (
    heard_in_descent,
    estimate_believable,
    upright_in_descent,
    steady_in_descent,
    inside_walls_in_descent,
)

DESCENT_RULES: tuple[Rule, ...] = (*_ANY_DESCENT, slow_in_descent)
"""While braking and landing."""

COURSE_DESCENT_RULES: tuple[Rule, ...] = (*_ANY_DESCENT, slow_after_course)
"""While landing from a test flight."""
