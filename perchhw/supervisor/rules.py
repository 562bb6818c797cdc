"""The safety rules: small, default-deny, each a pure function of one observation.

A rule returns ``None`` when what it guards is known to be good, and a :class:`Violation` otherwise: a missing
value is a violation. Which rules hold when is the three tuples at the end.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from math import degrees, dist, hypot, isfinite, pi, radians

from mocap_bridge.health import Verdict
from onboard.room import RoomGeometry
from perchhw.supervisor.observation import Observation


@dataclass(frozen=True, slots=True)
class Violation:
    """A rule that does not hold: its name, what was measured, and what was demanded."""

    rule: str
    measured: str
    demanded: str

    def __str__(self) -> str:
        return f"{self.rule}: {self.measured}, need {self.demanded}"


@dataclass(frozen=True, kw_only=True)
class SafetyLimits:
    """Limits of the safety rules, in SI units.

    Attributes:
        link_silence: longest silence of the drone (it answers echoes at 10 Hz), s.
        pose_age: oldest good mocap pose before arming (where the health monitor says stale), s.
        pose_age_bridged: oldest one that the drone's own estimate bridges (lost at 0.5 s), s.
        telemetry_age: oldest usable onboard value, s.
        battery_age: oldest usable battery reading (it is sent at 10 Hz), s.
        battery_at_rest: least voltage with motors off; a lower pack sags below what 15 gf needs (the
            authors' lowest pack at rest: 3.83 V), V.
        battery_in_flight: least voltage under load; 15 gf of one motor needs 2.72 V (errata 1), V.
        disagreement_on_ground: largest distance of the onboard estimate from the mocap pose, m.
        disagreement_in_flight: the same in flight, where the estimate lags the pose by the latency, m.
        yaw_disagreement: largest heading difference before arming, rad.
        tilt_on_ground: largest tilt before arming, rad.
        tilt_in_hover: largest tilt while hovering and moving to the start, rad.
        tilt_in_test_flight: likewise during a test flight; the controller asks for 50 deg at most, rad.
        speed_on_ground: largest speed of the estimate before arming, m/s.
        height_on_ground: greatest height of the body's origin before arming, m.
        room: the flight volume.
        wall_margin: distance to the sides of the volume that must remain, m.
        start_mark: where the drone must stand before arming: x and y in m, heading in rad; None: anywhere.
        start_mark_distance: how far from it, m. A person puts a drone down within a few cm; a room that was
            calibrated anew, or another drone's mark, is farther off (engineering estimate).
        start_mark_heading: how far from its heading, rad (likewise).
    """

    link_silence: float = 0.5
    pose_age: float = 0.1
    pose_age_bridged: float = 0.3
    telemetry_age: float = 0.25
    battery_age: float = 1.0
    battery_at_rest: float = 3.8
    battery_in_flight: float = 2.72
    disagreement_on_ground: float = 0.05
    disagreement_in_flight: float = 0.25
    yaw_disagreement: float = radians(5.0)
    tilt_on_ground: float = radians(10.0)
    tilt_in_hover: float = radians(35.0)
    tilt_in_test_flight: float = radians(65.0)
    speed_on_ground: float = 0.15
    height_on_ground: float = 0.25
    room: RoomGeometry = field(default_factory=RoomGeometry)
    wall_margin: float = 0.0
    start_mark: tuple[float, float, float] | None = None
    start_mark_distance: float = 0.25
    start_mark_heading: float = radians(15.0)


Rule = Callable[[Observation, SafetyLimits], Violation | None]


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


def link_alive(o: Observation, limits: SafetyLimits) -> Violation | None:
    """The drone answered recently."""
    return _at_most("link_silence", o.link_silence, limits.link_silence, "s")


def _bad_pose(o: Observation) -> Violation:
    verdict = "unknown" if o.pose_verdict is None else o.pose_verdict.name
    measured = verdict if o.pose_problem is None else f"{verdict} ({o.pose_problem})"
    return Violation("pose", measured, Verdict.OK.name)


def pose_good(o: Observation, limits: SafetyLimits) -> Violation | None:
    """The pose stream is healthy, and its last good pose is fresh."""
    if o.pose_verdict is not Verdict.OK:
        return _bad_pose(o)
    return _at_most("pose_age", o.pose_age, limits.pose_age, "s")


def pose_usable(o: Observation, limits: SafetyLimits) -> Violation | None:
    """Once begun, lost and rejected frames are bridged by the drone's own estimate, but not for long."""
    if o.pose_verdict in (None, Verdict.UNKNOWN, Verdict.LOST):
        return _bad_pose(o)
    return _at_most("pose_age", o.pose_age, limits.pose_age_bridged, "s")


def estimate_fresh(o: Observation, limits: SafetyLimits) -> Violation | None:
    """The onboard estimate arrives."""
    return _at_most("estimate_age", o.estimate_age, limits.telemetry_age, "s")


def _distance(o: Observation) -> float | None:
    if o.pose_position is None or o.estimate_position is None:
        return None
    return dist(o.pose_position, o.estimate_position)


def estimate_agrees_on_ground(o: Observation, limits: SafetyLimits) -> Violation | None:
    """Onboard position and heading agree with mocap before the motors turn."""
    apart = _at_most("estimate_to_mocap", _distance(o), limits.disagreement_on_ground, "m")
    if apart is not None:
        return apart
    if o.pose_attitude is None or o.estimate_attitude is None:
        return Violation("heading_to_mocap", "unknown", "known")
    difference = _turn(o.estimate_attitude.yaw, o.pose_attitude.yaw)
    return _at_most("heading_to_mocap", degrees(difference), degrees(limits.yaw_disagreement), "deg")


def _turn(a: float, b: float) -> float:
    """Angle between two headings, 0 to pi rad."""
    return abs((a - b + pi) % (2 * pi) - pi)


def estimate_agrees_in_flight(o: Observation, limits: SafetyLimits) -> Violation | None:
    """Onboard position agrees with mocap in flight."""
    return _at_most("estimate_to_mocap", _distance(o), limits.disagreement_in_flight, "m")


def drone_known(o: Observation, limits: SafetyLimits) -> Violation | None:
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


def drone_can_arm(o: Observation, limits: SafetyLimits) -> Violation | None:
    """The drone's preflight checks passed."""
    if o.drone is None or not o.drone.can_arm:
        return Violation("drone_can_arm", "no" if o.drone else "unknown", "yes")
    return None


def drone_can_fly(o: Observation, limits: SafetyLimits) -> Violation | None:
    """The drone is armed and lets its motors turn."""
    if o.drone is None or not o.drone.can_fly:
        return Violation("drone_can_fly", "no" if o.drone else "unknown", "yes")
    return None


def battery_at_rest(o: Observation, limits: SafetyLimits) -> Violation | None:
    """The pack is charged."""
    return _at_most("battery_age", o.battery_age, limits.battery_age, "s") or _at_least(
        "battery_at_rest", o.battery_voltage, limits.battery_at_rest, "V"
    )


def battery_in_flight(o: Observation, limits: SafetyLimits) -> Violation | None:
    """The pack still gives the thrust that the flip needs."""
    return _at_most("battery_age", o.battery_age, limits.battery_age, "s") or _at_least(
        "battery_in_flight", o.battery_voltage, limits.battery_in_flight, "V"
    )


def upright_on_ground(o: Observation, limits: SafetyLimits) -> Violation | None:
    """The drone stands upright on the floor."""
    tilt = None if o.pose_attitude is None else degrees(o.pose_attitude.tilt)
    height = None if o.pose_position is None else o.pose_position[2]
    return _at_most("tilt_on_ground", tilt, degrees(limits.tilt_on_ground), "deg") or _at_most(
        "height_on_ground", height, limits.height_on_ground, "m"
    )


def upright_in_hover(o: Observation, limits: SafetyLimits) -> Violation | None:
    """The drone does not tilt more than hovering and slow moves need."""
    tilt = None if o.estimate_attitude is None else degrees(o.estimate_attitude.tilt)
    return _at_most("tilt_in_hover", tilt, degrees(limits.tilt_in_hover), "deg")


def upright_in_test_flight(o: Observation, limits: SafetyLimits) -> Violation | None:
    """The drone does not tilt more than a controller that is in command would have it."""
    tilt = None if o.estimate_attitude is None else degrees(o.estimate_attitude.tilt)
    return _at_most("tilt_in_test_flight", tilt, degrees(limits.tilt_in_test_flight), "deg")


def inside_room(o: Observation, limits: SafetyLimits) -> Violation | None:
    """Mocap sees the drone inside the flight volume."""
    if o.pose_position is None:
        return Violation("inside_room", "unknown", "known")
    if not limits.room.contains(*o.pose_position, margin=limits.wall_margin):
        place = ", ".join(f"{value:.2f}" for value in o.pose_position)
        return Violation("inside_room", f"({place}) m", f"inside {limits.room}")
    return None


def on_start_mark(o: Observation, limits: SafetyLimits) -> Violation | None:
    """The drone stands on the start mark, as it must in a room that has one."""
    if limits.start_mark is None:
        return None
    x, y, yaw = limits.start_mark
    distance = None if o.pose_position is None else hypot(o.pose_position[0] - x, o.pose_position[1] - y)
    turn = None if o.pose_attitude is None else degrees(_turn(o.pose_attitude.yaw, yaw))
    return _at_most("start_mark_distance", distance, limits.start_mark_distance, "m") or _at_most(
        "start_mark_heading", turn, degrees(limits.start_mark_heading), "deg"
    )


def calm_on_ground(o: Observation, limits: SafetyLimits) -> Violation | None:
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

PREFLIGHT_RULES: tuple[Rule, ...] = (*GROUND_RULES, pose_good, on_start_mark, drone_can_arm)
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


def first_violation(
    rules: tuple[Rule, ...], observation: Observation, limits: SafetyLimits
) -> Violation | None:
    """The first of `rules` that does not hold, or ``None`` when all do."""
    for rule in rules:
        violation = rule(observation, limits)
        if violation is not None:
            return violation
    return None
