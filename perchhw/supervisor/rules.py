"""The safety rules up to the trigger: small, default-deny, each a pure function of one admitted observation.

A rule returns ``None`` when what it guards is known to be good, and a :class:`Violation` otherwise: a missing
value is a violation. Which rules hold when is the tuples at the end.
"""

from math import degrees, hypot, pi

from mocap_bridge.health import PoseVerdict
from perchhw.supervisor.limits import SafetyLimits
from perchhw.supervisor.observation import Admitted
from perchhw.supervisor.space import (
    HOVER_ENVELOPE,
    TEST_FLIGHT_ENVELOPE,
    clear_of_ceiling,
    clear_of_floor,
    clear_of_walls,
    inside_room,
    steady_in_hover,
)
from perchhw.supervisor.violation import Rule, Violation, at_least, at_most


def link_alive(o: Admitted, limits: SafetyLimits) -> Violation | None:
    """The drone answered recently."""
    return at_most("link_silence", o.link_silence, limits.link_silence, "s")


def _bad_pose(o: Admitted) -> Violation:
    verdict = "unknown" if o.pose_verdict is None else o.pose_verdict.name
    measured = verdict if o.pose_problem is None else f"{verdict} ({o.pose_problem})"
    return Violation("pose", measured, PoseVerdict.OK.name)


def pose_good(o: Admitted, limits: SafetyLimits) -> Violation | None:
    """The pose stream is healthy, and its last good pose is fresh."""
    if o.pose_verdict is not PoseVerdict.OK:
        return _bad_pose(o)
    return at_most("pose_age", o.pose_age, limits.pose_age, "s")


def pose_usable(o: Admitted, limits: SafetyLimits) -> Violation | None:
    """Once begun, lost and rejected frames are bridged by the drone's own estimate, but not for long."""
    if o.pose_verdict in (None, PoseVerdict.UNKNOWN, PoseVerdict.LOST):
        return _bad_pose(o)
    return at_most("pose_age", o.pose_age, limits.pose_age_bridged, "s")


def estimate_fresh(o: Admitted, limits: SafetyLimits) -> Violation | None:
    """The onboard estimate arrives."""
    return at_most("estimate_age", o.estimate_age, limits.telemetry_age, "s")


def estimate_agrees_on_ground(o: Admitted, limits: SafetyLimits) -> Violation | None:
    """Onboard position and heading agree with mocap before the motors turn."""
    apart = at_most("estimate_to_mocap", o.estimate_to_pose, limits.disagreement_on_ground, "m")
    if apart is not None:
        return apart
    if o.pose_attitude is None or o.estimate_attitude is None:
        return Violation("heading_to_mocap", "unknown", "known")
    difference = _turn(o.estimate_attitude.yaw, o.pose_attitude.yaw)
    return at_most("heading_to_mocap", degrees(difference), degrees(limits.yaw_disagreement), "deg")


def _turn(a: float, b: float) -> float:
    """Angle between two headings, 0 to pi rad."""
    return abs((a - b + pi) % (2 * pi) - pi)


def estimate_agrees_in_flight(o: Admitted, limits: SafetyLimits) -> Violation | None:
    """Onboard position agrees with mocap in flight, both at the same time."""
    return at_most("estimate_to_mocap", o.estimate_to_pose, limits.disagreement_in_flight, "m")


def drone_known(o: Admitted, limits: SafetyLimits) -> Violation | None:
    """The drone's own supervisor answers, and reports neither a tumble nor a lock nor a crash."""
    stale = at_most("drone_state_age", o.drone_age, limits.telemetry_age, "s")
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


def _battery(name: str, o: Admitted, least: float, limits: SafetyLimits) -> Violation | None:
    return (
        at_most("battery_age", o.battery_age, limits.battery_age, "s")
        or at_least(name, o.battery_voltage, least, "V")
        or at_most("battery_full", o.battery_voltage, limits.battery_full, "V")
    )


def battery_at_rest(o: Admitted, limits: SafetyLimits) -> Violation | None:
    """The pack is charged, and what reports it reports a voltage that a pack can have."""
    return _battery("battery_at_rest", o, limits.battery_at_rest, limits)


def battery_in_flight(o: Admitted, limits: SafetyLimits) -> Violation | None:
    """The pack still gives the thrust that the flip needs."""
    return _battery("battery_in_flight", o, limits.battery_in_flight, limits)


def parameters_as_needed(o: Admitted, limits: SafetyLimits) -> Violation | None:
    """The parameters that decide who flies and whether motors stop were read back from the drone."""
    if o.parameters_ok:
        return None
    measured = "unknown" if o.parameters_ok is None else "wrong"
    if o.parameters_problem is not None:
        measured = f"{measured} ({o.parameters_problem})"
    return Violation(
        "parameters", measured, "controller, estimator, idle thrust, motor override and vehicle as needed"
    )


def policy_known(o: Admitted, limits: SafetyLimits) -> Violation | None:
    """What the drone says of its live policy is not old."""
    return at_most("policy_crc_age", o.policy_crc_age, limits.telemetry_age, "s")


def landing_state_known(o: Admitted, limits: SafetyLimits) -> Violation | None:
    """The landing app says where it stands, in a word that is known here: only that tells a trigger."""
    stale = at_most("landing_age", o.landing_age, limits.telemetry_age, "s")
    if stale is None and o.landing_state is None:
        return Violation("landing_state", "unknown", "known")
    return stale


def upright_on_ground(o: Admitted, limits: SafetyLimits) -> Violation | None:
    """The drone stands upright on the floor."""
    tilt = None if o.pose_attitude is None else degrees(o.pose_attitude.tilt)
    height = None if o.pose_position is None else o.pose_position[2] - limits.room.floor_z
    return at_most("tilt_on_ground", tilt, degrees(limits.tilt_on_ground), "deg") or at_most(
        "height_on_ground", height, limits.height_on_ground, "m"
    )


def calm_on_ground(o: Admitted, limits: SafetyLimits) -> Violation | None:
    """The estimate stands still before arming: a drifting estimator has not converged."""
    speed = None if o.estimate_velocity is None else hypot(*o.estimate_velocity)
    return at_most("speed_on_ground", speed, limits.speed_on_ground, "m/s")


def on_start_mark(o: Admitted, limits: SafetyLimits) -> Violation | None:
    """The drone stands on the start mark, as it must in a room that has one."""
    if limits.start_mark is None:
        return None
    x, y, yaw = limits.start_mark
    distance = None if o.pose_position is None else hypot(o.pose_position[0] - x, o.pose_position[1] - y)
    turn = None if o.pose_attitude is None else degrees(_turn(o.pose_attitude.yaw, yaw))
    return at_most("start_mark_distance", distance, limits.start_mark_distance, "m") or at_most(
        "start_mark_heading", turn, degrees(limits.start_mark_heading), "deg"
    )


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
    parameters_as_needed,
)
"""While the drone stands on its start mark."""

PREFLIGHT_RULES: tuple[Rule, ...] = (*GROUND_RULES, pose_good, on_start_mark, drone_can_arm)
"""Before the motors may be armed."""

_AIRBORNE: tuple[Rule, ...] = (
    link_alive,
    drone_known,
    drone_can_fly,
    pose_usable,
    inside_room,
    estimate_fresh,
    estimate_agrees_in_flight,
    battery_in_flight,
    clear_of_walls,
)

TAKE_OFF_RULES: tuple[Rule, ...] = (*_AIRBORNE, clear_of_ceiling, *HOVER_ENVELOPE)
"""On the way from the floor to the first hover."""

HOVER_RULES: tuple[Rule, ...] = (*TAKE_OFF_RULES, clear_of_floor)
"""From the first hover to the start of the approach."""

TEST_FLIGHT_RULES: tuple[Rule, ...] = (
    *_AIRBORNE,
    clear_of_ceiling,
    clear_of_floor,
    *TEST_FLIGHT_ENVELOPE,
)
"""While a test flight follows its course."""

APPROACH_RULES: tuple[Rule, ...] = (*_AIRBORNE, clear_of_floor, steady_in_hover, landing_state_known)
"""During the approach, until the trigger, beside the corridor (:mod:`perchhw.supervisor.corridor`): nothing
here may cost a landing that is going well."""
