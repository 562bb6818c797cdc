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
    """The estimate by which the drone lands is near what mocap sees, or, while blind, at least plausible."""
    if _only_late(o, limits):
        return None
    if o.estimate_position is None or o.estimate_velocity is None:
        return Violation("descent_estimate", "unknown", "known")
    if o.pose_position is not None:
        return at_most("descent_disagreement", o.estimate_to_pose, limits.descent_disagreement, "m")
    return at_most("descent_speed_blind", hypot(*o.estimate_velocity), limits.descent_speed, "m/s")


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


DESCENT_RULES: tuple[Rule, ...] = (
    heard_in_descent,
    estimate_believable,
    upright_in_descent,
    inside_walls_in_descent,
)
"""While braking and landing."""
