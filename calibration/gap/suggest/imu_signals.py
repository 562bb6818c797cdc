"""What effects of sensing and timing do to the IMU against motion capture along a flight."""

import numpy as np
from scipy.spatial.transform import Rotation

from calibration.gap.data.record import FlightRecord
from onboard.arrays import FloatArray
from onboard.gravity import GRAVITY
from onboard.vehicle import Vehicle

SENSING = frozenset({"pose_delay", "pose_rotation", "pose_offset", "gyro_bias"})
"""Effects that this module knows."""


def imu_against_pose(record: FlightRecord, vehicle: Vehicle) -> FloatArray:
    """Specific force (m/s2) and rate (rad/s) that the IMU shows beyond those of motion capture, shape (n, 6).

    Zero for a vehicle without effects of sensing.

    Args:
        record: true motion of a flight.
        vehicle: its effects of sensing are applied to what is seen.
    """
    values = {effect.name: effect.values() for effect in vehicle.effects if effect.name in SENSING}
    if not values:
        return np.zeros((record.t.size, 6))
    delay = values.get("pose_delay", {}).get("delay", 0.0)
    turn, offset, bias = (
        np.array([values.get(name, {}).get(axis, 0.0) for axis in "xyz"])
        for name in ("pose_rotation", "pose_offset", "gyro_bias")
    )
    true = _imu_of_pose(record, 0.0, np.zeros(3), np.zeros(3))
    difference = true - _imu_of_pose(record, delay, turn, offset)
    difference[:, 3:] += bias
    return difference


def _imu_of_pose(record: FlightRecord, delay: float, turn: FloatArray, offset: FloatArray) -> FloatArray:
    """Specific force and rate of a pose that is `delay` s old, turned (rad) and shifted (m), shape (n, 6)."""
    t, dt = record.t, record.dt
    position = np.column_stack([np.interp(t - delay, t, record.position[:, i]) for i in range(3)])
    late = np.column_stack([np.interp(t - delay, t, record.attitude[:, i]) for i in range(4)])
    attitude = Rotation.from_quat(late)
    position = position + attitude.apply(offset)
    # As the description says, q_seen = q exp(turn / 2): a rotation vector of `turn`.
    seen = attitude * Rotation.from_rotvec(turn)
    acceleration = np.gradient(np.gradient(position, dt, axis=0), dt, axis=0)
    force = seen.apply(acceleration + np.array([0.0, 0.0, GRAVITY]), inverse=True)
    step = (seen[:-1].inv() * seen[1:]).as_rotvec() / dt
    rate = np.vstack((step[:1], 0.5 * (step[1:] + step[:-1]), step[-1:]))
    return np.hstack((force, rate))
