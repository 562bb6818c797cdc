"""Rules about where the drone may be, how fast and how tilted: fence and envelope.

The fence looks ahead: a drone at `p` with the velocity `v` towards a boundary can still be stopped before it
only if p + v * latency + v^2 / (2 a) does not lie beyond.
"""

from math import degrees, hypot

from perchhw.supervisor.limits import SafetyLimits
from perchhw.supervisor.observation import Admitted, Attitude
from perchhw.supervisor.violation import Rule, Violation, at_least, at_most

_NAMES = ("x_min", "x_max", "y_min", "y_max")


def inside_room(o: Admitted, limits: SafetyLimits) -> Violation | None:
    """Mocap sees the drone inside the flight volume."""
    if o.pose_position is None:
        return Violation("inside_room", "unknown", "known")
    if not limits.room.contains(*o.pose_position, margin=limits.wall_margin):
        place = ", ".join(f"{value:.2f}" for value in o.pose_position)
        return Violation("inside_room", f"({place}) m", f"inside {limits.room}")
    return None


def _ahead(o: Admitted, speed: float, limits: SafetyLimits) -> float:
    """Distance until a motion at `speed` (m/s) that the estimate tells is stopped, m; 0 when it recedes."""
    if speed <= 0.0:
        return 0.0
    return speed * (limits.latency + (o.estimate_age or 0.0)) + speed * speed / (2.0 * limits.braking)


def clear_of_walls(o: Admitted, limits: SafetyLimits) -> Violation | None:
    """The drone can stop before it reaches a wall."""
    if o.estimate_position is None or o.estimate_velocity is None:
        return Violation("fence_walls", "unknown", "known")
    room = limits.room
    (x, y, _), (vx, vy, _) = o.estimate_position, o.estimate_velocity
    left = (
        x - room.x_min - _ahead(o, -vx, limits),
        room.x_max - x - _ahead(o, vx, limits),
        y - room.y_min - _ahead(o, -vy, limits),
        room.y_max - y - _ahead(o, vy, limits),
    )
    least = min(left)
    return at_least(f"fence_{_NAMES[left.index(least)]}", least, limits.wall_margin, "m to stop in")


def clear_of_ceiling(o: Admitted, limits: SafetyLimits) -> Violation | None:
    """The drone can stop before it reaches the ceiling."""
    if o.estimate_position is None or o.estimate_velocity is None:
        return Violation("fence_ceiling", "unknown", "known")
    x, y, z = o.estimate_position
    room = limits.room
    # A ceiling that tilts comes nearer to a drone that flies along it.
    vx, vy, vz = o.estimate_velocity
    slope_x = room.ceiling_at(x + 1.0, y) - room.ceiling_at(x, y)
    slope_y = room.ceiling_at(x, y + 1.0) - room.ceiling_at(x, y)
    closing = vz - slope_x * vx - slope_y * vy
    left = room.ceiling_at(x, y) - z - _ahead(o, closing, limits)
    return at_least("fence_ceiling", left, 0.0, "m to stop in")


def clear_of_floor(o: Admitted, limits: SafetyLimits) -> Violation | None:
    """The drone can stop before it reaches the floor."""
    if o.estimate_position is None or o.estimate_velocity is None:
        return Violation("fence_floor", "unknown", "known")
    left = o.estimate_position[2] - limits.room.floor_z - _ahead(o, -o.estimate_velocity[2], limits)
    return at_least("fence_floor", left, 0.0, "m to stop in")


def _tilt(attitude: Attitude | None) -> float | None:
    return None if attitude is None else degrees(attitude.tilt)


def _speed(o: Admitted) -> float | None:
    return None if o.estimate_velocity is None else hypot(*o.estimate_velocity)


def _rotation(o: Admitted) -> float | None:
    return None if o.body_rates is None else hypot(*o.body_rates)


def upright_in_hover(o: Admitted, limits: SafetyLimits) -> Violation | None:
    """The drone does not tilt more than hovering and slow moves need."""
    return at_most("tilt_in_hover", _tilt(o.estimate_attitude), degrees(limits.tilt_in_hover), "deg")


def upright_in_test_flight(o: Admitted, limits: SafetyLimits) -> Violation | None:
    """The drone does not tilt more than a controller that is in command would have it."""
    limit = degrees(limits.tilt_in_test_flight)
    return at_most("tilt_in_test_flight", _tilt(o.estimate_attitude), limit, "deg")


def slow_in_hover(o: Admitted, limits: SafetyLimits) -> Violation | None:
    """The drone is not faster than its moves between hovers."""
    return at_most("speed_in_hover", _speed(o), limits.speed_in_hover, "m/s")


def slow_in_test_flight(o: Admitted, limits: SafetyLimits) -> Violation | None:
    """The drone is not faster than any course."""
    return at_most("speed_in_test_flight", _speed(o), limits.speed_in_test_flight, "m/s")


def steady_in_hover(o: Admitted, limits: SafetyLimits) -> Violation | None:
    """The drone does not spin."""
    stale = at_most("rates_age", o.rates_age, limits.telemetry_age, "s")
    return stale or at_most("rotation_in_hover", _rotation(o), limits.rotation_in_hover, "rad/s")


def steady_in_test_flight(o: Admitted, limits: SafetyLimits) -> Violation | None:
    """The drone does not spin faster than flown on purpose."""
    stale = at_most("rates_age", o.rates_age, limits.telemetry_age, "s")
    return stale or at_most("rotation_in_test_flight", _rotation(o), limits.rotation_in_test_flight, "rad/s")


HOVER_ENVELOPE: tuple[Rule, ...] = (upright_in_hover, slow_in_hover, steady_in_hover)
TEST_FLIGHT_ENVELOPE: tuple[Rule, ...] = (upright_in_test_flight, slow_in_test_flight, steady_in_test_flight)
