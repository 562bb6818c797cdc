"""The limits of the safety rules, each with its source (docs/safety.md shows them beside their rules)."""

from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from typing import NamedTuple

from onboard.bounds import Bounds
from onboard.quantity import convert
from onboard.room import RoomGeometry


class Allowed(NamedTuple):
    """What a lab file may make of one limit, in its SI unit.

    Attributes:
        default: the limit where the lab file says nothing.
        strictest: beyond it the rule would end flights that are good (or drop landings that still work).
        loosest: beyond it the rule would not protect any more; equal to the default where the default is
            already as loose as may be.
        bounds: both ends in order, with unit and reasons.
    """

    default: float
    strictest: float
    loosest: float
    bounds: Bounds

    @property
    def fixed(self) -> bool:
        """Whether the limit may be made stricter only."""
        return self.loosest == self.default


def _deg(angle: float) -> float:
    """An angle in rad, to the last bit as the ``deg`` of a lab file come out."""
    return convert(angle, "deg", "rad")


def _limit(default: float, unit: str, *, strictest: tuple[float, str], loosest: tuple[float, str]) -> float:
    """A limit, and the range that a lab file may choose from: its ends, and why it ends there."""
    (least, why_least), (most, why_most) = sorted((strictest, loosest))
    bounds = Bounds(unit, least, most, why_least, why_most)
    return field(default=default, metadata={"allowed": Allowed(default, strictest[0], loosest[0], bounds)})


@dataclass(frozen=True, kw_only=True)
class SafetyLimits:
    """Limits of the safety rules, in SI units.

    Attributes:
        link_silence: longest silence of the drone (it answers echoes at 10 Hz), s.
        pose_age: oldest good mocap pose before arming (where the health monitor says stale), s.
        pose_age_bridged: oldest one that the drone's own estimate bridges (lost at 0.5 s), s.
        telemetry_age: oldest usable onboard value, s.
        battery_age: oldest usable battery reading (it is sent at 10 Hz), s.
        battery_filter: time constant of the voltage's low-pass, s: as long as a flip, so that neither one
            sample nor one burst of thrust decides.
        battery_at_rest: least voltage with motors off; a lower pack sags below what 15 gf needs (the
            authors' lowest pack at rest: 3.83 V), V.
        battery_in_flight: least voltage under load; 15 gf of one motor needs 2.72 V (errata 1), V.
        battery_full: greatest voltage; a high-voltage cell is charged to 4.35, any other to 4.2, and
            the drone measures to 1 %, V.
        disagreement_on_ground: largest distance of the onboard estimate from the mocap pose, m.
        disagreement_in_flight: the same in flight, where the estimate lags the pose by the latency, m.
        yaw_disagreement: largest heading difference before arming, rad.
        tilt_on_ground: largest tilt before arming, rad.
        tilt_in_hover: largest tilt while hovering and moving to the start, rad.
        tilt_in_test_flight: likewise during a test flight; the controller asks for 50 deg at most, rad.
        speed_on_ground: largest speed of the estimate before arming, m/s.
        speed_in_hover: largest speed between take-off and approach; moves at a mean of 0.8 m/s peak at
            1.75 and were seen at 2.0, m/s.
        speed_in_test_flight: likewise during a test flight, whose fastest course asks for 6, m/s.
        rotation_in_hover: largest body rate up to the trigger; the authors' approaches stay below 2, a
            drone that is hit or loses a propeller is above at once, rad/s.
        rotation_in_test_flight: likewise during a test flight; 17 is the most in 62 min of real flights
            (NanoBench, arXiv 2603.09908), rad/s.
        height_on_ground: greatest height of the body's origin above the floor before arming, m.
        room: the flight volume.
        wall_margin: distance to the sides of the volume that must remain, m.
        start_mark: where the drone must stand before arming: x and y in m, heading in rad; None: anywhere.
        start_mark_distance: how far from it, m. A person puts a drone down within a few cm; a room that was
            calibrated anew, or another drone's mark, is farther off (engineering estimate).
        start_mark_heading: how far from its heading, rad (likewise).
        latency: from a motion to what the host orders against it, by reckoning: mocap 35 ms, telemetry
            10 ms, tick 20 ms, command 35 ms, s.
        braking: acceleration with which a drone that is told to is sure to stop, m/s2: what the test
            flights' library asks of it at most, two thirds of what the controller's 50 deg give.
        corridor_distance: farthest from the planned approach; the authors' flights stay within 0.38, the
            drone itself breaks off at 0.5 to the side, m.
        corridor_speed: largest difference from the planned velocity; the authors' within 0.80, m/s.
        corridor_tilt: largest angle between thrust axis and the planned one; the authors' within 18 deg, rad.
        corridor_time: how much earlier or later than planned the drone may be, s: the delay of the start
            and of its telemetry, and the rounding of the drone's path (0.08).
        flight_time: longest time in the air besides the planned approach or course; every phase at its
            deadline takes 35 in a room of 8.5 m, s.
        flip_drop: deepest fall below the height of the trigger before the motors are cut; a flip that
            begins at rest loses 0.4 m in the 0.275 s of the authors' longest, m.
        hang_distance: farthest below the ceiling of a body that is held; two feet of any leg design hold it
            at 0.087 at most, the ceiling's height and markers are good to 0.04, m.
        hang_tilt: largest tilt from upside down of a body that four feet hold: hinges give way by 2 deg,
            two feet let it hang at 15 deg or more, rad.
        descent_silence: longest silence of the drone while it brakes or lands; its own watchdog bites after
            as long without the host, s.
        descent_disagreement: farthest that the estimate by which it lands may be from mocap, m: four times
            what already ended the flight.
        descent_speed: largest speed while braking and landing; the fastest approach flown is 3 m/s, m/s.
        descent_speed_after_course: likewise while landing from a test flight, whose fastest course asks for
            6; a landing from 5.8 m/s was above 4 for 0.38 s (simulated lab), m/s.
        descent_tilt: largest tilt of a descent; the drone's own limit outside a flip is 70 deg, rad.
        descent_rotation: largest body rate of a descent; brakes and landings in the simulated lab stay below
            6, real flights of any kind below 17 (as `rotation_in_test_flight`), rad/s.
        descent_escape: farthest beyond the walls while braking or landing, m: `disagreement_in_flight`.
    """

    link_silence: float = _limit(
        0.5,
        "s",
        strictest=(0.3, "three lost echoes in a row are nothing unusual"),
        loosest=(0.5, "half of the drone's watchdog, so that a landing is ordered before it bites"),
    )
    pose_age: float = _limit(
        0.1,
        "s",
        strictest=(0.03, "healthy motion capture is late by a frame or two"),
        loosest=(0.1, "the health monitor says stale there"),
    )
    pose_age_bridged: float = _limit(
        0.3,
        "s",
        strictest=(0.1, "a marker that is hidden for some frames is nothing unusual"),
        loosest=(0.4, "mocap is lost, and the firmware levels, at 0.5 s"),
    )
    telemetry_age: float = _limit(
        0.25,
        "s",
        strictest=(0.1, "a radio link loses some packets in a row"),
        loosest=(0.3, "the drone flies on by as much unseen"),
    )
    battery_age: float = _limit(
        1.0,
        "s",
        strictest=(0.3, "three lost readings in a row are nothing unusual"),
        loosest=(1.0, "after ten lost readings nothing is known of the pack"),
    )
    battery_filter: float = _limit(
        0.2,
        "s",
        strictest=(0.1, "a single sample would decide"),
        loosest=(0.4, "the pack would fail before it shows"),
    )
    battery_at_rest: float = _limit(
        3.8,
        "V",
        strictest=(4.1, "a full cell rests at little more"),
        loosest=(3.8, "a lower pack sags below what a flip needs"),
    )
    battery_in_flight: float = _limit(
        2.72,
        "V",
        strictest=(3.3, "a good pack sags to it"),
        loosest=(2.72, "15 gf of one motor need as much"),
    )
    battery_full: float = _limit(
        4.4,
        "V",
        strictest=(4.25, "a full cell of 4.2 V, as the drone measures it"),
        loosest=(4.4, "no cell of a Crazyflie goes higher, as the drone measures it"),
    )
    disagreement_on_ground: float = _limit(
        0.05,
        "m",
        strictest=(0.02, "it is the noise of the estimate"),
        loosest=(0.1, "the estimate has not converged"),
    )
    disagreement_in_flight: float = _limit(
        0.25,
        "m",
        strictest=(0.15, "at 3 m/s the estimate lags by 0.1 m"),
        loosest=(0.35, "that is no lag any more, and walls may be as near"),
    )
    yaw_disagreement: float = _limit(
        _deg(5.0),
        "rad",
        strictest=(_deg(2.0), "it is the noise of the estimate"),
        loosest=(_deg(10.0), "a run-up of 3 m would end 0.5 m aside"),
    )
    tilt_on_ground: float = _limit(
        _deg(10.0),
        "rad",
        strictest=(_deg(3.0), "floors and feet are not more even"),
        loosest=(_deg(15.0), "such a drone does not stand on its feet"),
    )
    tilt_in_hover: float = _limit(
        _deg(35.0),
        "rad",
        strictest=(_deg(15.0), "moves between hovers tilt by 10 deg, and swing"),
        loosest=(_deg(45.0), "a controller in command tilts less even in test flights (50 deg at most)"),
    )
    tilt_in_test_flight: float = _limit(
        _deg(65.0),
        "rad",
        strictest=(_deg(55.0), "the controller asks for 50 deg"),
        loosest=(_deg(70.0), "the drone's own limit outside a flip"),
    )
    speed_on_ground: float = _limit(
        0.15,
        "m/s",
        strictest=(0.05, "it is the noise of the estimate"),
        loosest=(0.25, "the estimate has not converged"),
    )
    speed_in_hover: float = _limit(
        2.5,
        "m/s",
        strictest=(2.2, "moves between hovers were seen at 2.0 m/s"),
        loosest=(3.0, "as fast as the fastest approach flown"),
    )
    speed_in_test_flight: float = _limit(
        7.0,
        "m/s",
        strictest=(2.0, "moves between hovers were seen at 2.0 m/s"),
        loosest=(7.0, "the fastest course asks for 6 m/s"),
    )
    rotation_in_hover: float = _limit(
        10.0,
        "rad/s",
        strictest=(4.0, "approaches turn at up to 2 rad/s"),
        loosest=(10.0, "a drone that is hit turns faster"),
    )
    rotation_in_test_flight: float = _limit(
        20.0,
        "rad/s",
        strictest=(10.0, "less would be stricter than in the hover"),
        loosest=(25.0, "real flights turn at 17 rad/s at most"),
    )
    height_on_ground: float = _limit(
        0.25,
        "m",
        strictest=(0.12, "the origin of a drone on long legs is at 0.07 m"),
        loosest=(0.25, "motors are disarmed below it"),
    )
    room: RoomGeometry = field(default_factory=RoomGeometry)
    wall_margin: float = _limit(
        0.0, "m", strictest=(1.0, "move the walls instead"), loosest=(0.0, "a wall is a wall")
    )
    start_mark: tuple[float, float, float] | None = None
    start_mark_distance: float = _limit(
        0.25,
        "m",
        strictest=(0.05, "nobody puts a drone down better"),
        loosest=(0.5, "it may be another drone's mark"),
    )
    start_mark_heading: float = _limit(
        _deg(15.0),
        "rad",
        strictest=(_deg(5.0), "nobody puts a drone down better"),
        loosest=(_deg(30.0), "it may be another drone's mark"),
    )
    latency: float = _limit(
        0.1,
        "s",
        strictest=(0.3, "three times what it is reckoned to be"),
        loosest=(0.1, "mocap, telemetry, tick and order take as long together"),
    )
    braking: float = _limit(
        8.0,
        "m/s2",
        strictest=(3.0, "a fence would be met in the middle of a room"),
        loosest=(8.0, "two thirds of what the controller's 50 deg give"),
    )
    corridor_distance: float = _limit(
        0.6,
        "m",
        strictest=(0.45, "good flights of the authors deviate by 0.38 m"),
        loosest=(0.75, "a quarter more than usual, which is half more than the drone's own to the side"),
    )
    corridor_speed: float = _limit(
        1.2,
        "m/s",
        strictest=(0.9, "good flights of the authors deviate by 0.80 m/s"),
        loosest=(1.5, "a quarter more than usual"),
    )
    corridor_tilt: float = _limit(
        _deg(35.0),
        "rad",
        strictest=(_deg(20.0), "good flights of the authors deviate by 18 deg"),
        loosest=(_deg(45.0), "a quarter more than usual"),
    )
    corridor_time: float = _limit(
        0.2,
        "s",
        strictest=(0.1, "the drone's path is rounded by 0.08 s"),
        loosest=(0.3, "the corridor is 0.9 m longer at 3 m/s"),
    )
    flight_time: float = _limit(
        60.0,
        "s",
        strictest=(40.0, "the phases of a flight take up to 35 s"),
        loosest=(120.0, "the longest move in the largest room takes 60 s more"),
    )
    flip_drop: float = _limit(
        0.5,
        "m",
        strictest=(0.45, "a flip that begins at rest loses 0.4 m"),
        loosest=(0.7, "what falls deeper does not reach the ceiling any more"),
    )
    hang_distance: float = _limit(
        0.15,
        "m",
        strictest=(0.13, "two feet hold at 0.087 m, ceiling and markers are good to 0.04 m"),
        loosest=(0.2, "a body that falls is 0.4 m lower after 0.3 s"),
    )
    hang_tilt: float = _limit(
        _deg(10.0),
        "rad",
        strictest=(_deg(7.0), "hinges give way by 2 deg, and ceilings tilt by up to 4"),
        loosest=(_deg(14.0), "two feet let it hang at 15 deg or more"),
    )
    descent_silence: float = _limit(
        1.0,
        "s",
        strictest=(0.6, "a landing that still works would be dropped, sooner than a flight is ended"),
        loosest=(1.0, "the drone's own watchdog bites then"),
    )
    descent_disagreement: float = _limit(
        1.0,
        "m",
        strictest=(0.5, "a landing that still works would be dropped"),
        loosest=(1.0, "four times what already ended the flight"),
    )
    descent_speed: float = _limit(
        4.0,
        "m/s",
        strictest=(3.5, "the fastest approach has 3 m/s to brake from"),
        loosest=(4.0, "nothing that brakes or lands is faster"),
    )
    descent_speed_after_course: float = _limit(
        7.0,
        "m/s",
        strictest=(6.5, "the fastest course asks for 6 m/s, and is landed from there"),
        loosest=(7.0, "what is faster has already ended its course"),
    )
    descent_tilt: float = _limit(
        _deg(75.0),
        "rad",
        strictest=(_deg(60.0), "a landing that still works would be dropped"),
        loosest=(_deg(75.0), "the drone's own limit is 70 deg"),
    )
    descent_rotation: float = _limit(
        20.0,
        "rad/s",
        strictest=(18.0, "real flights turn at 17 rad/s at most"),
        loosest=(20.0, "in 0.3 s a drone turns by more than 340 deg"),
    )
    descent_escape: float = _limit(
        0.25,
        "m",
        strictest=(0.1, "the estimate is not better"),
        loosest=(0.25, "people may be behind the walls"),
    )


def allowed_limits() -> Mapping[str, Allowed]:
    """What a lab file may set, by name: every number among the safety limits."""
    return {
        item.name: item.metadata["allowed"] for item in fields(SafetyLimits) if "allowed" in item.metadata
    }
