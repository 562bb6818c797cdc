"""One flight: approach at constant velocity, flip, landing; as a table of what would be logged.

State: position, momentum, rotation matrix and angular momentum, all in the world frame, at 20 kHz.
"""

from dataclasses import dataclass

import numpy as np

from tests.truth.landings import contact
from tests.truth.landings.drone import Drone, newton, volts
from tests.truth.landings.jit import jitted

H = 5e-5  # s
LOG_STEPS = 100  # 200 Hz
CONTROL_STEPS = 40  # 500 Hz
GRAVITY = 9.81
COLUMNS = ("t", "x", "y", "z", "qx", "qy", "qz", "qw", "gx", "gy", "gz", "m1", "m2", "m3", "m4", "vbat")
SIDES = np.array([[1.0, -1.0], [-1.0, -1.0], [-1.0, 1.0], [1.0, 1.0]])  # of motors and legs, x and y


@dataclass(frozen=True)
class Attempt:
    """What is commanded: m/s, rad above the horizon, s to the ceiling, N m (negative: nose up)."""

    speed: float
    angle: float
    tau: float
    moment: float
    ceiling: float = 2.1
    before: float = 0.75
    after: float = 1.3


@dataclass(frozen=True)
class Noise:
    """Standard deviations: of the log (m, rad, rad/s), and of torque and force (per inertia and mass)."""

    position: float = 2e-4
    attitude: float = np.radians(0.17)
    gyro: float = 0.01
    torque: float = 2.2
    torque_time: float = 0.06
    force: float = 0.06
    force_time: float = 0.4
    gyro_range: float = np.radians(2000.0)


@jitted
def _turned(R, w, h):
    """R after the world rate w for h (Rodrigues)."""
    angle = np.sqrt(w @ w) * h
    if angle < 1e-14:
        return R
    n = w / np.sqrt(w @ w)
    S = np.array([[0.0, -n[2], n[1]], [n[2], 0.0, -n[0]], [-n[1], n[0], 0.0]])
    return (np.eye(3) + np.sin(angle) * S + (1.0 - np.cos(angle)) * (S @ S)) @ R


@jitted
def advance(
    n,
    x,
    p,
    R,
    L,
    thrust,
    target,
    arm,
    lever,
    lag,
    hips,
    rests,
    mode,
    anchors,
    points,
    discs,
    push,
    twist,
    steps,
):
    """`steps` of 50 us: rotors, then momenta, then places.

    `push` (N, world) and `twist` (N m, body) are gusts.
    Returns the rotation matrix; the other arrays change in place, and whether the hull touched.
    """
    inertia = np.array([n[contact.IXX], n[contact.IYY], n[contact.IZZ]])
    touched = False
    for _ in range(steps):
        for k in range(4):
            tau = lag[0] if target[k] > thrust[k] else lag[1]
            thrust[k] += (target[k] - thrust[k]) * (1.0 - np.exp(-H / tau))
        body = twist.copy()
        for k in range(4):
            body[0] += arm[k, 1] * thrust[k]
            body[1] -= arm[k, 0] * thrust[k]
        body[2] += lever * (thrust[1] + thrust[3] - thrust[0] - thrust[2])
        total = np.zeros(6)
        lift, turning = np.sum(thrust), R @ body
        for i in range(3):
            total[i], total[3 + i] = push[i] + lift * R[i, 2], turning[i]
        total[2] -= n[contact.MASS] * 9.81
        v = p / n[contact.MASS]
        spin = R @ ((R.T @ L) / inertia)
        if x[2] > n[contact.CEILING] - 0.2:
            contact.feet(n, x, v, R, spin, hips, rests, mode, anchors, total)
            touched = contact.hull(n, x, v, R, spin, points, discs, total) or touched
        p += H * total[:3]
        L += H * total[3:]
        x += H * p / n[contact.MASS]
        R = _turned(R, R @ ((R.T @ L) / inertia), H)
    return R, touched


def numbers(drone: Drone, ceiling: float) -> np.ndarray:
    return np.array(
        [drone.mass, *drone.inertia, drone.leg, drone.stiffness, drone.damping, drone.stop,
         drone.rod_stiffness, drone.rod_damping, drone.adhesion, drone.preload, drone.restitution,
         drone.hull_friction, drone.foot_friction, drone.foot_radius, ceiling, drone.propeller_radius,
         drone.capture, drone.side_stiffness, drone.side_damping]
    )  # fmt: skip


def quaternion(R: np.ndarray) -> np.ndarray:
    """Scalar-last quaternion of a rotation matrix, by its dominant eigenvector (Bar-Itzhack)."""
    (a, b, c), (d, e, f), (g, h, i) = R
    K = np.array(
        [
            [a - e - i, 0, 0, 0],
            [b + d, e - a - i, 0, 0],
            [c + g, f + h, i - a - e, 0],
            [h - f, c - g, d - b, a + e + i],
        ]
    )  # fmt: skip
    return np.linalg.eigh(K, UPLO="L")[1][:, -1]


def orthogonal(R: np.ndarray) -> np.ndarray:
    """The nearest rotation matrix."""
    u, _, v = np.linalg.svd(R)
    return u @ v


def held_velocity(drone: Drone, v: np.ndarray, goal: np.ndarray, R: np.ndarray, w: np.ndarray) -> np.ndarray:
    """Thrusts of a cascaded velocity controller with yaw 0: acceleration, tilt, rate."""
    wanted = 3.0 * (goal - v) + np.array([0.0, 0.0, GRAVITY])
    tilt = R.T @ (wanted / np.linalg.norm(wanted))
    yaw = np.arctan2(R[1, 0], R[0, 0])
    accel = 160.0 * np.array([-tilt[1], tilt[0], -0.3 * yaw]) - 22.0 * w
    torque = np.array(drone.inertia) * accel
    each = drone.mass * float(wanted @ R[:, 2]) / 4.0
    mixed = each + torque[0] * SIDES[:, 1] / (4 * drone.arm) - torque[1] * SIDES[:, 0] / (4 * drone.arm)
    mixed += torque[2] * np.array([-1.0, 1.0, -1.0, 1.0]) / (4 * drone.torque_length)
    return np.clip(mixed, 0.0, drone.thrust_most)


def fly(drone: Drone, attempt: Attempt, noise: Noise, rng: np.random.Generator) -> dict[str, np.ndarray]:
    """The log of an attempt by column, 200 rows a second.

    ``feet``, ``hull``, ``touch`` and ``trigger`` (s; NaN: never) are the truth.
    """
    n = numbers(drone, attempt.ceiling)
    goal = attempt.speed * np.array([np.cos(attempt.angle), 0.0, np.sin(attempt.angle)])
    x = np.array([0.0, 0.0, attempt.ceiling]) - attempt.before * goal
    p, R, L = drone.mass * goal, np.eye(3), np.zeros(3)
    thrust = np.full(4, drone.mass * GRAVITY / 4)
    hips = np.column_stack([SIDES * drone.hip, np.full(4, drone.hip_z)])
    lean = np.sin(drone.leg_angle) / np.sqrt(2.0)
    rests = np.column_stack([SIDES * lean, np.full(4, -np.cos(drone.leg_angle))])
    box = drone.box_half
    points = np.array(
        [
            [sx * box, sy * box, z]
            for sx in (-1, 1)
            for sy in (-1, 1)
            for z in (drone.box_top, drone.box_bottom)
        ]
    )
    arm = SIDES * drone.arm
    discs = np.column_stack([arm, np.full(4, drone.propeller_z)])
    lag = np.array([drone.lag_up, drone.lag_down])
    mode, anchors = np.zeros(4, dtype=np.int64), np.zeros((4, 3))
    twist, push = np.zeros(3), np.zeros(3)
    inertia = np.array(drone.inertia)
    fade = np.exp(-CONTROL_STEPS * H / np.array([noise.torque_time, noise.force_time]))
    flipping = cut = hit = False
    touch = trigger = np.nan
    rows: list[list[float]] = []
    ticks = round((attempt.before + attempt.after) / (CONTROL_STEPS * H))
    piece = CONTROL_STEPS // 2  # control every two, a row of the log every five
    elapsed = 0
    for _ in range(ticks):
        w = (R.T @ L) / inertia
        flipping = flipping or attempt.ceiling - x[2] <= attempt.tau * p[2] / drone.mass
        if flipping and np.isnan(trigger):
            trigger = elapsed * H
        cut = cut or (flipping and R[2, 2] <= 0.0)
        if not flipping:
            wish = held_velocity(drone, p / drone.mass, goal, R, w)
        else:
            front = 0.0 if cut else min(abs(attempt.moment) / (2 * drone.arm), drone.thrust_most)
            wish = np.array([front, 0.0, 0.0, front])
        voltage = drone.battery - drone.resistance * drone.ampere_per_newton * float(thrust.sum())
        duty = np.round(np.clip([volts(f) / voltage for f in wish], 0, 1) * 65535 / 2) * 2
        duty = np.minimum(duty, 65534)
        target = np.array([newton(d / 65535 * voltage) for d in duty])
        spread = np.sqrt(1.0 - fade**2)
        twist = fade[0] * twist + spread[0] * noise.torque * inertia * rng.standard_normal(3)
        push = fade[1] * push + spread[1] * noise.force * drone.mass * rng.standard_normal(3)
        held = np.any(mode == contact.HELD)
        quiet = 0.0 if held else 1.0  # the air's unrest belongs to running rotors
        for _ in range(2):
            R, touched = advance(
                n, x, p, R, L, thrust, target, arm, drone.torque_length, lag, hips, rests, mode, anchors,
                points, discs, quiet * push, quiet * twist, piece,
            )  # fmt: skip
            hit = hit or touched
            if np.isnan(touch) and (touched or np.any(mode != contact.FREE)):
                touch = elapsed * H
            elapsed += piece
            if elapsed % LOG_STEPS == 0:
                rows.append([elapsed * H, *x, *quaternion(R), *((R.T @ L) / inertia), *duty, voltage])
        R = orthogonal(R)
    log = np.array(rows)
    data = dict(zip(COLUMNS, log.T, strict=True))
    _blur(data, noise, rng)
    data["feet"] = np.array(float(np.sum(mode == contact.HELD)))
    data["hull"] = np.array(float(hit))
    data["touch"] = np.array(touch)
    data["trigger"] = np.array(trigger)
    return data


def _blur(data: dict[str, np.ndarray], noise: Noise, rng: np.random.Generator) -> None:
    """Sensor noise, in place: position, attitude (right-multiplied small turns), gyro with its range."""
    count = data["t"].size
    for axis in "xyz":
        data[axis] = data[axis] + noise.position * rng.standard_normal(count)
        rate = data[f"g{axis}"] + noise.gyro * rng.standard_normal(count)
        data[f"g{axis}"] = np.clip(rate, -noise.gyro_range, noise.gyro_range)
    turn = 0.5 * noise.attitude * rng.standard_normal((3, count))
    x, y, z, w = (data[k].copy() for k in ("qx", "qy", "qz", "qw"))
    a, b, c = turn
    mixed = (
        x + w * a + y * c - z * b,
        y + w * b + z * a - x * c,
        z + w * c + x * b - y * a,
        w - x * a - y * b - z * c,
    )
    size = np.sqrt(sum(q**2 for q in mixed))
    for key, q in zip(("qx", "qy", "qz", "qw"), mixed, strict=True):
        data[key] = q / size
