"""The limits of the safety rules, each with its source (docs/safety.md shows them beside their rules)."""

from dataclasses import dataclass, field
from math import radians

from onboard.room import RoomGeometry


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
            1.75 and were seen at 1.91, m/s.
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
        latency: from a motion to what the host orders against it: mocap 35 ms, telemetry 10 ms, tick
            20 ms, command 35 ms, s.
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
        descent_speed: largest speed of an estimate that is believed while blind; the fastest approach
            flown is 3 m/s, m/s.
        descent_tilt: largest tilt of a descent; the drone's own limit outside a flip is 70 deg, rad.
        descent_escape: farthest beyond the walls while braking or landing, m: `disagreement_in_flight`.
    """

    link_silence: float = 0.5
    pose_age: float = 0.1
    pose_age_bridged: float = 0.3
    telemetry_age: float = 0.25
    battery_age: float = 1.0
    battery_filter: float = 0.2
    battery_at_rest: float = 3.8
    battery_in_flight: float = 2.72
    battery_full: float = 4.4
    disagreement_on_ground: float = 0.05
    disagreement_in_flight: float = 0.25
    yaw_disagreement: float = radians(5.0)
    tilt_on_ground: float = radians(10.0)
    tilt_in_hover: float = radians(35.0)
    tilt_in_test_flight: float = radians(65.0)
    speed_on_ground: float = 0.15
    speed_in_hover: float = 2.5
    speed_in_test_flight: float = 7.0
    rotation_in_hover: float = 10.0
    rotation_in_test_flight: float = 20.0
    height_on_ground: float = 0.25
    room: RoomGeometry = field(default_factory=RoomGeometry)
    wall_margin: float = 0.0
    start_mark: tuple[float, float, float] | None = None
    start_mark_distance: float = 0.25
    start_mark_heading: float = radians(15.0)
    latency: float = 0.1
    braking: float = 8.0
    corridor_distance: float = 0.6
    corridor_speed: float = 1.2
    corridor_tilt: float = radians(35.0)
    corridor_time: float = 0.2
    flight_time: float = 60.0
    flip_drop: float = 0.5
    hang_distance: float = 0.15
    hang_tilt: float = radians(10.0)
    descent_silence: float = 1.0
    descent_disagreement: float = 1.0
    descent_speed: float = 4.0
    descent_tilt: float = radians(75.0)
    descent_escape: float = 0.25
