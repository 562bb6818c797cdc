"""What the supervisor is told of one instant. ``None`` means unknown, and unknown never flies.

Telemetry fills an :class:`Observation` with what arrived, as it arrived: attitudes as raw quaternions, values
however absurd. The gate (:mod:`perchhw.supervisor.gate`) makes an :data:`Admitted` of it, in which everything
that is not fit to be believed is ``None``; only that is shown to rules and phases.
"""

from dataclasses import dataclass
from math import acos, atan2, dist, sqrt
from typing import NewType

from mocap_bridge.health import PoseVerdict
from onboard.app_interface import EndReason, LandingState
from onboard.arrays import Quaternion, Vector
from onboard.supervisor_info import SupervisorInfo

UNIT_TOLERANCE = 0.01
"""How far a quaternion's length may be from 1. The drone's log rounds to float32 and its estimator lets the
length drift by parts in 10,000; what is off by more than this is no rotation."""


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
    def from_quaternion(cls, quaternion: Quaternion) -> "Attitude | None":
        """From a quaternion (x, y, z, w), body to world; ``None`` for one that is not of unit length."""
        length = sqrt(sum(part * part for part in quaternion))
        if not abs(length - 1.0) <= UNIT_TOLERANCE:
            return None
        x, y, z, w = (part / length for part in quaternion)
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
        pose_quaternion: attitude of the last good mocap pose, (x, y, z, w), body to world.
        estimate_age: age of the onboard estimate (the drone's own clock must have advanced).
        estimate_position: onboard position estimate.
        estimate_velocity: onboard velocity estimate, m/s, world frame.
        estimate_quaternion: attitude of the onboard estimate, (x, y, z, w), body to world.
        rates_age: age of the body rates.
        body_rates: of the drone's gyro, rad/s, body frame.
        drone: the drone's own supervisor bits.
        drone_age: age of those bits.
        battery_voltage: under the present load, V; once admitted it is filtered.
        battery_age: age of that reading.
        landing_state: state of the landing state machine on the drone.
        landing_age: age of that state, of `end_reason` and of `trigger_count`.
        end_reason: why the drone ended its approach.
        trigger_count: triggers since boot.
        active_policy_crc: CRC32 of the policy that is live on the drone.
        policy_crc_age: age of that CRC.
        policy_armed, trajectory_armed: the two switches of the landing app as last read back from the drone.
        parameters_ok: controller, estimator, idle thrust and motor override were read back and are as needed.
        parameters_problem: which of them is not, in words, or ``None``.
    """

    link_silence: float | None = None
    pose_verdict: PoseVerdict | None = None
    pose_problem: str | None = None
    pose_age: float | None = None
    pose_position: Vector | None = None
    pose_quaternion: Quaternion | None = None
    estimate_age: float | None = None
    estimate_position: Vector | None = None
    estimate_velocity: Vector | None = None
    estimate_quaternion: Quaternion | None = None
    rates_age: float | None = None
    body_rates: Vector | None = None
    drone: SupervisorInfo | None = None
    drone_age: float | None = None
    battery_voltage: float | None = None
    battery_age: float | None = None
    landing_state: LandingState | None = None
    landing_age: float | None = None
    end_reason: EndReason | None = None
    trigger_count: int | None = None
    active_policy_crc: int | None = None
    policy_crc_age: float | None = None
    policy_armed: bool | None = None
    trajectory_armed: bool | None = None
    parameters_ok: bool | None = None
    parameters_problem: str | None = None

    @property
    def estimate_to_pose(self) -> float | None:
        """Distance of the estimate from the last good mocap pose, m; unknown when one of them is.

        The two are of different times: the pose is moved on, by the estimate's velocity, to that of the
        estimate. Compared as they are, an estimate without fault is 0.25 m off after 0.1 s at 2.5 m/s.
        """
        pose, estimate, velocity = self.pose_position, self.estimate_position, self.estimate_velocity
        if pose is None or estimate is None or velocity is None:
            return None
        if self.pose_age is None or self.estimate_age is None:
            return None
        elapsed = self.pose_age - self.estimate_age
        return dist([p + v * elapsed for p, v in zip(pose, velocity, strict=True)], estimate)

    @property
    def pose_attitude(self) -> Attitude | None:
        """Attitude of the last good mocap pose."""
        return None if self.pose_quaternion is None else Attitude.from_quaternion(self.pose_quaternion)

    @property
    def estimate_attitude(self) -> Attitude | None:
        """Attitude of the onboard estimate."""
        return (
            None if self.estimate_quaternion is None else Attitude.from_quaternion(self.estimate_quaternion)
        )


Admitted = NewType("Admitted", Observation)
"""An observation that has passed the gate; what was not fit to be believed is ``None`` in it."""
