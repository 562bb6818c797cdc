"""The limits of the safety rules, each with its source."""

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
        battery_filter: time constant of the voltage's low-pass, s.
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
    """

    link_silence: float = 0.5
    pose_age: float = 0.1
    pose_age_bridged: float = 0.3
    telemetry_age: float = 0.25
    battery_age: float = 1.0
    battery_filter: float = 0.2
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
