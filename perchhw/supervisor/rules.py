"""The safety rules: small, default-deny, each a pure function of one observation.

A rule returns ``None`` when what it guards is known to be good, and a :class:`Violation` otherwise: a missing
value is a violation. Which rules hold when is the three tuples at the end.
"""

from collections.abc import Callable
from dataclasses import dataclass
from math import degrees, dist, hypot, isfinite, pi

from mocap_bridge.health import Verdict
from perchhw.supervisor.limits import SafetyLimits
from perchhw.supervisor.observation import Admitted


@dataclass(frozen=True, slots=True)
class Violation:
    """A rule that does not hold: its name, what was measured, and what was demanded."""

    rule: str
    measured: str
    demanded: str

    def __str__(self) -> str:
        return f"{self.rule}: {self.measured}, need {self.demanded}"


Rule = Callable[[Admitted, SafetyLimits], Violation | None]


def _at_most(rule: str, value: float | None, limit: float, unit: str) -> Violation | None:
    """`value` is known, finite and not above `limit`."""
    if value is None:
        return Violation(rule, "unknown", f"at most {limit:g} {unit}")
    if not isfinite(value) or value > limit:
        return Violation(rule, f"{value:.3g} {unit}", f"at most {limit:g} {unit}")
    return None


def _at_least(rule: str, value: float | None, limit: float, unit: str) -> Violation | None:
    """`value` is known, finite and not below `limit`."""
    if value is None:
        return Violation(rule, "unknown", f"at least {limit:g} {unit}")
    if not isfinite(value) or value < limit:
        return Violation(rule, f"{value:.3g} {unit}", f"at least {limit:g} {unit}")
    return None


def link_alive(o: Admitted, limits: SafetyLimits) -> Violation | None:
    """The drone answered recently."""
    return _at_most("link_silence", o.link_silence, limits.link_silence, "s")


def _bad_pose(o: Admitted) -> Violation:
    verdict = "unknown" if o.pose_verdict is None else o.pose_verdict.name
    measured = verdict if o.pose_problem is None else f"{verdict} ({o.pose_problem})"
    return Violation("pose", measured, Verdict.OK.name)


def pose_good(o: Admitted, limits: SafetyLimits) -> Violation | None:
    """The pose stream is healthy, and its last good pose is fresh."""
    if o.pose_verdict is not Verdict.OK:
        return _bad_pose(o)
    return _at_most("pose_age", o.pose_age, limits.pose_age, "s")


def pose_usable(o: Admitted, limits: SafetyLimits) -> Violation | None:
    """Once begun, lost and rejected frames are bridged by the drone's own estimate, but not for long."""
    if o.pose_verdict in (None, Verdict.UNKNOWN, Verdict.LOST):
        return _bad_pose(o)
    return _at_most("pose_age", o.pose_age, limits.pose_age_bridged, "s")


def estimate_fresh(o: Admitted, limits: SafetyLimits) -> Violation | None:
    """The onboard estimate arrives."""
    return _at_most("estimate_age", o.estimate_age, limits.telemetry_age, "s")


def _distance(o: Admitted) -> float | None:
    if o.pose_position is None or o.estimate_position is None:
        return None
    return dist(o.pose_position, o.estimate_position)


def estimate_agrees_on_ground(o: Admitted, limits: SafetyLimits) -> Violation | None:
    """Onboard position and heading agree with mocap before the motors turn."""
    apart = _at_most("estimate_to_mocap", _distance(o), limits.disagreement_on_ground, "m")
    if apart is not None:
        return apart
    if o.pose_attitude is None or o.estimate_attitude is None:
        return Violation("heading_to_mocap", "unknown", "known")
    difference = abs((o.estimate_attitude.yaw - o.pose_attitude.yaw + pi) % (2 * pi) - pi)
    return _at_most("heading_to_mocap", degrees(difference), degrees(limits.yaw_disagreement), "deg")


def estimate_agrees_in_flight(o: Admitted, limits: SafetyLimits) -> Violation | None:
    """Onboard position agrees with mocap in flight."""
    return _at_most("estimate_to_mocap", _distance(o), limits.disagreement_in_flight, "m")


def drone_known(o: Admitted, limits: SafetyLimits) -> Violation | None:
    """The drone's own supervisor answers, and reports neither a tumble nor a lock nor a crash."""
    stale = _at_most("drone_state_age", o.drone_age, limits.telemetry_age, "s")
    if stale is not None:
        return stale
    if o.drone is None:
        return Violation("drone_state", "unknown", "known")
    for wrong, name in (
        (o.drone.is_locked, "locked"),
        (o.drone.is_tumbled, "tumbled"),
        (o.drone.is_crashed, "crashed"),
    ):
        if wrong:
            return Violation("drone_state", name, "upright and unlocked (reboot the drone on its start mark)")
    return None


def drone_can_arm(o: Admitted, limits: SafetyLimits) -> Violation | None:
    """The drone's preflight checks passed."""
    if o.drone is None or not o.drone.can_arm:
        return Violation("drone_can_arm", "no" if o.drone else "unknown", "yes")
    return None


def drone_can_fly(o: Admitted, limits: SafetyLimits) -> Violation | None:
    """The drone is armed and lets its motors turn."""
    if o.drone is None or not o.drone.can_fly:
        return Violation("drone_can_fly", "no" if o.drone else "unknown", "yes")
    return None


def battery_at_rest(o: Admitted, limits: SafetyLimits) -> Violation | None:
    """The pack is charged."""
    return _at_most("battery_age", o.battery_age, limits.battery_age, "s") or _at_least(
        "battery_at_rest", o.battery_voltage, limits.battery_at_rest, "V"
    )


def battery_in_flight(o: Admitted, limits: SafetyLimits) -> Violation | None:
    """The pack still gives the thrust that the flip needs."""
    return _at_most("battery_age", o.battery_age, limits.battery_age, "s") or _at_least(
        "battery_in_flight", o.battery_voltage, limits.battery_in_flight, "V"
    )


def upright_on_ground(o: Admitted, limits: SafetyLimits) -> Violation | None:
    """The drone stands upright on the floor."""
    tilt = None if o.pose_attitude is None else degrees(o.pose_attitude.tilt)
    height = None if o.pose_position is None else o.pose_position[2]
    return _at_most("tilt_on_ground", tilt, degrees(limits.tilt_on_ground), "deg") or _at_most(
        "height_on_ground", height, limits.height_on_ground, "m"
    )


def upright_in_hover(o: Admitted, limits: SafetyLimits) -> Violation | None:
    """The drone does not tilt more than hovering and slow moves need."""
    tilt = None if o.estimate_attitude is None else degrees(o.estimate_attitude.tilt)
    return _at_most("tilt_in_hover", tilt, degrees(limits.tilt_in_hover), "deg")


def upright_in_test_flight(o: Admitted, limits: SafetyLimits) -> Violation | None:
    """The drone does not tilt more than a controller that is in command would have it."""
    tilt = None if o.estimate_attitude is None else degrees(o.estimate_attitude.tilt)
    return _at_most("tilt_in_test_flight", tilt, degrees(limits.tilt_in_test_flight), "deg")


def inside_room(o: Admitted, limits: SafetyLimits) -> Violation | None:
    """Mocap sees the drone inside the flight volume."""
    if o.pose_position is None:
        return Violation("inside_room", "unknown", "known")
    if not limits.room.contains(*o.pose_position, margin=limits.wall_margin):
        place = ", ".join(f"{value:.2f}" for value in o.pose_position)
        return Violation("inside_room", f"({place}) m", f"inside {limits.room}")
    return None


def calm_on_ground(o: Admitted, limits: SafetyLimits) -> Violation | None:
    """The estimate stands still before arming: a drifting estimator has not converged."""
    speed = None if o.estimate_velocity is None else hypot(*o.estimate_velocity)
    return _at_most("speed_on_ground", speed, limits.speed_on_ground, "m/s")


GROUND_RULES: tuple[Rule, ...] = (
    link_alive,
    drone_known,
    pose_usable,
    inside_room,
    upright_on_ground,
    estimate_fresh,
    estimate_agrees_on_ground,
    calm_on_ground,
    battery_at_rest,
)
"""While the drone stands on its start mark."""

PREFLIGHT_RULES: tuple[Rule, ...] = (*GROUND_RULES, pose_good, drone_can_arm)
"""Before the motors may be armed."""

HOVER_RULES: tuple[Rule, ...] = (
    link_alive,
    drone_known,
    drone_can_fly,
    pose_usable,
    inside_room,
    estimate_fresh,
    estimate_agrees_in_flight,
    upright_in_hover,
    battery_in_flight,
)
"""From take-off to the start of the approach."""

TEST_FLIGHT_RULES: tuple[Rule, ...] = (
    *(rule for rule in HOVER_RULES if rule is not upright_in_hover),
    upright_in_test_flight,
)
"""While a test flight follows its course."""

APPROACH_RULES: tuple[Rule, ...] = (
    link_alive,
    drone_known,
    pose_usable,
    inside_room,
    estimate_fresh,
    estimate_agrees_in_flight,
)
"""During the approach, until the trigger: nothing here may cost a landing that is going well."""


def first_violation(rules: tuple[Rule, ...], observation: Admitted, limits: SafetyLimits) -> Violation | None:
    """The first of `rules` that does not hold, or ``None`` when all do."""
    for rule in rules:
        violation = rule(observation, limits)
        if violation is not None:
            return violation
    return None
