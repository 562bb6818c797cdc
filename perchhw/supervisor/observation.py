"""What the supervisor knows at one instant. ``None`` means unknown, and unknown never flies."""

from dataclasses import dataclass
from math import acos, atan2

from mocap_bridge.health import Verdict
from onboard.app_interface import EndReason, LandingState
from onboard.arrays import Quaternion, Vector
from onboard.supervisor_info import SupervisorInfo


@dataclass(frozen=True, slots=True, kw_only=True)
class Attitude:
    """Tilt and heading of the body, both in rad.

    Attributes:
        tilt: angle between the body's z axis and the world's, 0 (upright) to pi (upside down).
        yaw: heading of the body's x axis in the world's horizontal plane.
    """

    tilt: float
    yaw: float

    @classmethod
    def from_quaternion(cls, quaternion: Quaternion) -> "Attitude":
        """From a unit quaternion (x, y, z, w), body to world."""
        x, y, z, w = quaternion
        up = 1.0 - 2.0 * (x * x + y * y)
        return cls(
            tilt=acos(max(-1.0, min(1.0, up))), yaw=atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class Observation:
    """One look at drone, room and link. Ages are in s at the time of the look; positions in m, world frame.

    Attributes:
        link_silence: time since the last packet from the drone.
        pose_verdict: the mocap health monitor's verdict on the pose stream.
        pose_problem: why there are no poses, in words, or ``None``.
        pose_age: age of the last good pose.
        pose_position: last good mocap position.
        pose_attitude: attitude of the last good mocap pose.
        estimate_age: age of the onboard estimate (the drone's own clock must have advanced).
        estimate_position: onboard position estimate.
        estimate_velocity: onboard velocity estimate, m/s, world frame.
        estimate_attitude: attitude of the onboard estimate.
        drone: the drone's own supervisor bits.
        drone_age: age of those bits.
        battery_voltage: under the present load, V.
        battery_age: age of that reading.
        landing_state: state of the landing state machine on the drone.
        landing_age: age of that state.
        end_reason: why the drone ended its approach.
        active_policy_crc: CRC32 of the policy that is live on the drone.
        trigger_count: triggers since boot.
    """

    link_silence: float | None = None
    pose_verdict: Verdict | None = None
    pose_problem: str | None = None
    pose_age: float | None = None
    pose_position: Vector | None = None
    pose_attitude: Attitude | None = None
    estimate_age: float | None = None
    estimate_position: Vector | None = None
    estimate_velocity: Vector | None = None
    estimate_attitude: Attitude | None = None
    drone: SupervisorInfo | None = None
    drone_age: float | None = None
    battery_voltage: float | None = None
    battery_age: float | None = None
    landing_state: LandingState | None = None
    landing_age: float | None = None
    end_reason: EndReason | None = None
    active_policy_crc: int | None = None
    trigger_count: int | None = None
