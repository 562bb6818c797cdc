"""Two pilots of the MuJoCo room: cascaded loops with Euler's angles, and tracking of a rotation matrix.

Both answer with the four rotors' thrusts. Gains follow from the rotors' lag: a rate loop of 1 / lag leaves a
phase margin of 52 deg, and each loop outside is two to four times slower.
"""

import math

import numpy as np

from tests.truth.airframe import G
from tests.truth.jit import jitted

Array = np.ndarray
CASCADED, GEOMETRIC = 0, 1


@jitted
def rotation(q: Array) -> Array:
    """Rotation matrix (body to world) of a quaternion, scalar first."""
    w, x, y, z = q
    return np.array([
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ])  # fmt: skip


@jitted
def steer(
    pilot: int, frame: Array, pose: Array, velocity: Array, goal: Array, total: Array, dt: float
) -> Array:
    """Thrusts (4, N) for a `goal` (place, velocity, acceleration, heading: 10 numbers).

    `frame` holds mass, arm, ix, iy, iz, yaw_lever, highest, lag; `pose` place and quaternion (scalar first),
    `velocity` of the place (world) and the body's rate; `total` is the pilot's integral, changed here.
    """
    mass, arm, yaw_lever, highest, lag = frame[0], frame[1], frame[5], frame[6], frame[7]
    rate_gain = 1.0 / lag
    tilt_gain = 0.35 * rate_gain
    speed_gain = 0.4 * tilt_gain
    place_gain = 0.5 * speed_gain
    error = place_gain * (goal[0:3] - pose[0:3]) + goal[3:6] - velocity[0:3]
    total += dt * error
    for k in range(3):
        total[k] = min(max(total[k], -2.0), 2.0)
    push = speed_gain * error + 0.3 * speed_gain * total + goal[6:9]
    r, w = rotation(pose[3:7]), velocity[3:6]
    if pilot == CASCADED:
        rate, lift = _cascaded(r, push, goal[9], tilt_gain)
    else:
        rate, lift = _geometric(r, push, goal[9], tilt_gain)
    m = frame[2:5] * np.array([rate_gain, rate_gain, 0.5 * rate_gain]) * (rate - w)
    lever = 4.0 * arm / math.sqrt(2.0)
    a, b, e = m[0] / lever, m[1] / lever, m[2] / (4.0 * yaw_lever)
    e = min(max(e, -0.1 * highest), 0.1 * highest)
    f = np.array([-a - b - e, -a + b + e, a + b - e, a - b + e]) + 0.25 * mass * lift
    return np.minimum(np.maximum(f, 0.03 * highest), highest)


@jitted
def _cascaded(r: Array, push: Array, heading: float, gain: float) -> tuple[Array, float]:
    c, s = math.cos(heading), math.sin(heading)
    forward, left = c * push[0] + s * push[1], -s * push[0] + c * push[1]
    pitch = min(max(math.atan2(forward, G + push[2]), -0.6), 0.6)
    roll = min(max(-math.atan2(left, G + push[2]), -0.6), 0.6)
    now_pitch, now_roll = -math.asin(min(max(r[2, 0], -1.0), 1.0)), math.atan2(r[2, 1], r[2, 2])
    turned = math.atan2(r[1, 0], r[0, 0]) - heading
    rate = np.array([gain * (roll - now_roll), gain * (pitch - now_pitch), -0.5 * gain * math.sin(turned)])
    return rate, (G + push[2]) / max(r[2, 2], 0.5)


@jitted
def _geometric(r: Array, push: Array, heading: float, gain: float) -> tuple[Array, float]:
    wanted = push + np.array([0.0, 0.0, G])
    wanted[2] = max(wanted[2], 2.0)
    z = wanted / math.sqrt((wanted * wanted).sum())
    x = np.array([math.cos(heading), math.sin(heading), 0.0])
    y = np.cross(z, x)
    y /= math.sqrt((y * y).sum())
    x = np.cross(y, z)
    d = np.stack((x, y, z)).T
    off = d.T @ r - r.T @ d
    rate = -gain * 0.5 * np.array([off[2, 1], off[0, 2], 0.5 * off[1, 0]])
    return rate, float((wanted * r[:, 2]).sum())
