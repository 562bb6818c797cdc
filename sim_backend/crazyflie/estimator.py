"""The simulated drone's state estimator: inertial prediction, corrected by external poses as they arrive.

A decoupled error-state Kalman filter: for each axis one (position, velocity) pair and one small attitude
error, with the process and measurement noise of the firmware's filter (bitcraze/crazyflie-firmware 2026.08,
``kalman_core_params_defaults.h``, ``crtp_localization_service.c``). At 100 Hz of poses it settles at fixed
gains: of each residual 0.058 to position, 0.16 /s to velocity (z 0.082, 0.33 /s), 0.072 to attitude. When
poses stop it dead-reckons and its variances grow. What it keeps of the real filter's weaknesses,
because a flight stack must cope with them:

- no gate and no validity check: a wrong, late or NaN pose goes straight in;
- the attitude residual is 2 vec / w (``mm_pose.c``): blind to sign and scale of the quaternion, singular for
  residuals near 180 degrees;
- a queue of 20 measurements (``estimator.c``); what arrives when it is full is dropped and counted;
- a state outside ``kalman.maxPos`` or ``kalman.maxVel`` resets the filter (``kalman_supervisor.c``).

Differences: the firmware's filter couples all nine states and predicts at 100 Hz; this one predicts at 1 kHz.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from onboard.arrays import FloatArray
from onboard.gravity import GRAVITY
from onboard.jit import kept
from onboard.rotation import euler_angles, from_yaw, integrate, rotate

QUEUE_LENGTH = 20
MAX_COVARIANCE = 100.0
MIN_COVARIANCE = 1e-6

# Layout of the filter's state vector.
POSITION, VELOCITY, QUATERNION, ACCELERATION = 0, 3, 6, 10
P_POSITION, P_CROSS, P_VELOCITY, P_ATTITUDE = 13, 16, 19, 22
SIZE = 25


@kept()
def _turn(x: FloatArray, rx: float, ry: float, rz: float) -> None:
    """Turn the attitude by the rotation vector (rad, body axes), in place; keeps it a unit quaternion."""
    x[6], x[7], x[8], x[9] = integrate((x[6], x[7], x[8], x[9]), (rx, ry, rz), 1.0)


@kept()
def _bounded(p: float) -> float:
    """A variance within the firmware's bounds (NaN becomes the upper one)."""
    if not p <= MAX_COVARIANCE:
        return MAX_COVARIANCE
    return max(p, MIN_COVARIANCE)


@kept()
def predict(x: FloatArray, acc: FloatArray, gyro: FloatArray, noise: FloatArray, dt: float) -> None:
    """One inertial step in place.

    Args:
        x: filter state (25,).
        acc: accelerometer (3,), m/s2, body.
        gyro: rate gyro (3,), rad/s, body.
        noise: process noise: acceleration xy and z [m/s2], gyro roll/pitch and yaw [rad/s].
        dt: s.
    """
    ax, ay, az = rotate((x[6], x[7], x[8], x[9]), acc)
    az -= GRAVITY
    x[10], x[11], x[12] = ax, ay, az
    for i in range(3):
        a = x[ACCELERATION + i]
        x[POSITION + i] += dt * (x[VELOCITY + i] + 0.5 * dt * a)
        x[VELOCITY + i] += dt * a
        q = noise[1] if i == 2 else noise[0]
        g = noise[3] if i == 2 else noise[2]
        pp, pv, vv = x[P_POSITION + i], x[P_CROSS + i], x[P_VELOCITY + i]
        x[P_POSITION + i] = _bounded(pp + dt * (2.0 * pv + dt * vv) + (q * dt * dt) ** 2)
        x[P_CROSS + i] = pv + dt * vv
        x[P_VELOCITY + i] = _bounded(vv + (q * dt) ** 2)
        x[P_ATTITUDE + i] = _bounded(x[P_ATTITUDE + i] + (g * dt) ** 2)
    _turn(x, gyro[0] * dt, gyro[1] * dt, gyro[2] * dt)


@kept()
def correct_position(x: FloatArray, px: float, py: float, pz: float, deviation: float) -> None:
    """Correct with a measured position (m, world), in place."""
    r = deviation * deviation
    for i in range(3):
        measured = px if i == 0 else (py if i == 1 else pz)
        pp, pv, vv = x[P_POSITION + i], x[P_CROSS + i], x[P_VELOCITY + i]
        error = measured - x[POSITION + i]
        x[POSITION + i] += pp / (pp + r) * error
        x[VELOCITY + i] += pv / (pp + r) * error
        x[P_POSITION + i] = _bounded(pp * r / (pp + r))
        x[P_CROSS + i] = pv * r / (pp + r)
        x[P_VELOCITY + i] = _bounded(vv - pv * pv / (pp + r))


@kept()
def correct_attitude(x: FloatArray, mx: float, my: float, mz: float, mw: float, deviation: float) -> None:
    """Correct with a measured attitude (quaternion x, y, z, w, any sign and scale), in place."""
    qx, qy, qz, qw = x[6], x[7], x[8], x[9]
    # residual = conjugate(estimate) * measurement: the turn still to make, in body axes
    ex = qw * mx - qx * mw - qy * mz + qz * my
    ey = qw * my + qx * mz - qy * mw - qz * mx
    ez = qw * mz - qx * my + qy * mx - qz * mw
    ew = qw * mw + qx * mx + qy * my + qz * mz
    if ew == 0.0:
        ew = 1e-300  # the firmware divides by zero here; the state is lost either way
    r = deviation * deviation
    k0 = x[P_ATTITUDE] / (x[P_ATTITUDE] + r)
    k1 = x[P_ATTITUDE + 1] / (x[P_ATTITUDE + 1] + r)
    k2 = x[P_ATTITUDE + 2] / (x[P_ATTITUDE + 2] + r)
    for i in range(3):
        p = x[P_ATTITUDE + i]
        x[P_ATTITUDE + i] = _bounded(p * r / (p + r))
    _turn(x, k0 * 2.0 * ex / ew, k1 * 2.0 * ey / ew, k2 * 2.0 * ez / ew)


@kept()
def out_of_bounds(x: FloatArray, max_position: float, max_velocity: float) -> bool:
    """Whether the state left the bounds (a bound of 0 is off; NaN passes, as in the firmware)."""
    for i in range(3):
        if max_position > 0.0 and abs(x[POSITION + i]) > max_position:
            return True
        if max_velocity > 0.0 and abs(x[VELOCITY + i]) > max_velocity:
            return True
    return False


@dataclass
class Settings:
    """Parameters ``kalman.*`` and ``locSrv.*``, with the firmware's defaults (SI, standard deviations)."""

    position_deviation: float = 0.01
    attitude_deviation: float = 0.0045
    max_position: float = 100.0
    max_velocity: float = 10.0
    initial: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 0.0)  # x, y, z [m], yaw [rad]


class Estimator:
    """The filter with its measurement queue. Call :meth:`step` once a ms."""

    def __init__(self) -> None:
        self.settings = Settings()
        #: acceleration xy, z [m/s2], gyro roll/pitch, yaw [rad/s]: ``kalman.pNAcc_*`` and ``mNGyro_*``
        self.noise: FloatArray = np.array([0.5, 1.0, 0.1, 0.1])
        self.state: FloatArray = np.zeros(SIZE)
        self.rejected = 0
        self.corrections = 0
        self._queue: list[tuple[float, ...]] = []
        self.reset()

    def reset(self) -> None:
        """Start anew from the initial position; the attitude is level (``kalman.resetEstimation``)."""
        px, py, pz, yaw = self.settings.initial
        x = self.state
        x[:] = 0.0
        x[POSITION : POSITION + 3] = px, py, pz
        x[QUATERNION : QUATERNION + 4] = from_yaw(yaw)
        x[P_POSITION : P_POSITION + 3] = MAX_COVARIANCE, MAX_COVARIANCE, 1.0
        x[P_VELOCITY : P_VELOCITY + 3] = 1e-4
        x[P_ATTITUDE : P_ATTITUDE + 3] = 1e-4

    def external_position(self, x: float, y: float, z: float) -> None:
        """Queue a position (m, world)."""
        self._push((x, y, z))

    def external_pose(self, x: float, y: float, z: float, qx: float, qy: float, qz: float, qw: float) -> None:
        """Queue a pose (m, world; quaternion body to world)."""
        self._push((x, y, z, qx, qy, qz, qw))

    def step(self, acc: FloatArray, gyro: FloatArray, dt: float) -> bool:
        """Predict by `dt` (s) and take in what is queued; True when out of bounds, and so reset."""
        predict(self.state, acc, gyro, self.noise, dt)
        if self._queue:
            for measurement in self._queue:
                self._correct(measurement)
            self._queue.clear()
        if out_of_bounds(self.state, self.settings.max_position, self.settings.max_velocity):
            self.reset()
            return True
        return False

    def _push(self, measurement: tuple[float, ...]) -> None:
        if len(self._queue) >= QUEUE_LENGTH:
            self.rejected += 1
        else:
            self._queue.append(measurement)

    def _correct(self, m: tuple[float, ...]) -> None:
        self.corrections += 1
        correct_position(self.state, m[0], m[1], m[2], self.settings.position_deviation)
        if len(m) == 7:
            correct_attitude(self.state, m[3], m[4], m[5], m[6], self.settings.attitude_deviation)

    # Views for logs and for the stages after the estimator.

    def position(self) -> tuple[float, float, float]:
        """m, world."""
        x: Any = self.state
        return (float(x[0]), float(x[1]), float(x[2]))

    def velocity(self) -> tuple[float, float, float]:
        """m/s, world."""
        x: Any = self.state
        return (float(x[3]), float(x[4]), float(x[5]))

    def quaternion(self) -> tuple[float, float, float, float]:
        """Attitude (x, y, z, w), body to world."""
        x: Any = self.state
        return (float(x[6]), float(x[7]), float(x[8]), float(x[9]))

    def roll_pitch_yaw(self) -> tuple[float, float, float]:
        """Z-Y-X Euler angles in FLU signs (pitch positive nose down), rad."""
        roll, pitch, yaw = euler_angles(self.quaternion())
        return roll, pitch, yaw
