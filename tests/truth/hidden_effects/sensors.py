"""What motion capture, gyro and accelerometer report."""

import math
from typing import Any

import numpy as np

from tests.truth.hidden_effects.jit import Array, jitted
from tests.truth.hidden_effects.rotation import rotation, sum3, turn


@jitted
def seen_pose(p: Any, states: Array, now: float, pose: Array) -> None:
    """What the motion capture reports (noiseless) at tick `now` (may be a fraction): `pose`, 7 numbers."""
    now = max(now, 0.0)
    k = min(int(now), states.shape[0] - 2) if states.shape[0] > 1 else 0
    f = now - k
    a, b = states[k], states[k + (1 if f > 0.0 else 0)]
    for n in range(4):
        pose[3 + n] = a[6 + n] + f * (b[6 + n] - a[6 + n])
    norm = math.sqrt(pose[3] ** 2 + pose[4] ** 2 + pose[5] ** 2 + pose[6] ** 2)
    r = np.empty((3, 3))
    rotation(pose[3] / norm, pose[4] / norm, pose[5] / norm, pose[6] / norm, r)
    t = p.tracked
    for n in range(3):
        pose[n] = a[n] + f * (b[n] - a[n]) + sum3(r[n, 0], r[n, 1], r[n, 2], t[0], t[1], t[2])
    for n in range(3, 7):
        pose[n] /= norm
    turn(pose[3:7], p.pose_turn[0], p.pose_turn[1], p.pose_turn[2])


@jitted
def blur(p: Any, noise: Array, pose: Array) -> None:
    """Add the motion capture's noise to a `pose`: position 0..2 and rotation vector 3..5, standard normal."""
    for k in range(3):
        pose[k] += p.position_noise * noise[k]
    a = p.attitude_noise
    turn(pose[3:7], a * noise[3], a * noise[4], a * noise[5])


@jitted
def inertial(
    p: Any, y: Array, dy: Array, scratch: Array, noise: Array, gyro: Array, accelerometer: Array
) -> None:
    """Gyro and accelerometer, which sit at `imu` from the centre of mass, with noise and bias, in counts."""
    wx, wy, wz, c = y[10], y[11], y[12], p.imu
    dot = wx * c[0] + wy * c[1] + wz * c[2]
    square = wx * wx + wy * wy + wz * wz
    swing0 = dy[11] * c[2] - dy[12] * c[1] + wx * dot - square * c[0]
    swing1 = dy[12] * c[0] - dy[10] * c[2] + wy * dot - square * c[1]
    swing2 = dy[10] * c[1] - dy[11] * c[0] + wz * dot - square * c[2]
    for k in range(3):
        swing = swing0 if k == 0 else (swing1 if k == 1 else swing2)
        a = scratch[3, k] + swing + p.accelerometer_bias[k] + p.accelerometer_noise * noise[3 + k]
        w = y[10 + k] + p.gyro_bias[k] + p.gyro_noise * noise[k]
        accelerometer[k] = p.accelerometer_count * math.floor(a / p.accelerometer_count + 0.5)
        gyro[k] = p.gyro_count * math.floor(w / p.gyro_count + 0.5)
