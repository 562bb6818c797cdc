"""The simulated drone's state estimator: inertial prediction, corrected by external poses as they arrive.

The filter itself is :mod:`sim_backend.crazyflie.kalman`, with the noise of the firmware's
(bitcraze/crazyflie-firmware 2026.08, ``kalman_core_params_defaults.h``, ``crtp_localization_service.c``). At
100 Hz of poses it settles at fixed gains. When poses stop it dead-reckons and its variances grow. Around it
stand the real one's weaknesses, because a flight stack must cope with them:

- no gate and no validity check: a wrong, late or NaN pose goes straight in;
- a queue of 20 measurements (``estimator.c``); what arrives when it is full is dropped and counted;
- a state outside ``kalman.maxPos`` or ``kalman.maxVel`` resets the filter (``kalman_supervisor.c``).
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from onboard.arrays import FloatArray
from onboard.rotation import euler_angles, from_yaw
from sim_backend.crazyflie import kalman

QUEUE_LENGTH = 20


@dataclass
class Settings:
    """Parameters ``kalman.*`` and ``locSrv.*``, with the firmware's defaults (SI, standard deviations)."""

    position_deviation: float = 0.01
    attitude_deviation: float = 0.0045
    max_position: float = 100.0
    max_velocity: float = 10.0
    initial: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 0.0)  # x, y, z [m], yaw [rad]


class Estimator:
    """The filter with its measurement queue. Call :meth:`step` once a ms.

    Attributes:
        settings: parameters.
        noise: (7,), SI: ``kalman.pNAcc_xy``, ``pNAcc_z``, ``mNGyro_rollpitch``, ``mNGyro_yaw``, ``pNVel``,
            ``pNPos``, ``pNAtt``.
        drag: (6,), 1/s and m: ``kalman.dragB_*`` and ``kalman.cop_*``.
        state: (25,), SI: what control and logs get, one ms old, laid out as in
            :mod:`sim_backend.crazyflie.kalman`.
        covariance: (9, 9), SI, of the errors of position (world), velocity and attitude (body).
        rejected: measurements that found the queue full.
        corrections: measurements taken in.
    """

    def __init__(self) -> None:
        self.settings = Settings()
        self.noise: FloatArray = np.array([0.5, 1.0, 0.1, 0.1, 0.0, 0.0, 0.0])
        self.drag: FloatArray = np.zeros(6)
        self.state: FloatArray = np.zeros(kalman.SIZE)
        self.rejected = 0
        self.corrections = 0
        self._memory: FloatArray = np.zeros(kalman.MEMORY_SIZE)
        self._memory[kalman.TO_PREDICTION] = kalman.FIRST_PREDICTION_MS
        self.covariance: FloatArray = np.zeros((kalman.ERRORS, kalman.ERRORS))
        self._queue: FloatArray = np.zeros((QUEUE_LENGTH, kalman.MEASUREMENT))
        self._queued = 0
        self.reset()

    def reset(self) -> None:
        """Start anew from the initial position; the attitude is level (``kalman.resetEstimation``)."""
        px, py, pz, yaw = map(float, self.settings.initial)
        kalman.start(self._memory, self.covariance, (px, py, pz), from_yaw(yaw))
        kalman.publish(self._memory, self.covariance, self.state)

    def external_position(self, x: float, y: float, z: float) -> None:
        """Queue a position (m, world)."""
        self._push((x, y, z, 0.0, 0.0, 0.0, 1.0), 0.0)

    def external_pose(self, x: float, y: float, z: float, qx: float, qy: float, qz: float, qw: float) -> None:
        """Queue a pose (m, world; quaternion body to world)."""
        self._push((x, y, z, qx, qy, qz, qw), 1.0)

    def step(self, acc: FloatArray, gyro: FloatArray, flying: bool) -> bool:
        """One ms: what was known goes out, what is queued comes in; True when out of bounds, and so reset.

        Args:
            acc: accelerometer (3,), m/s2, body.
            gyro: rate gyro (3,), rad/s, body.
            flying: what the supervisor says.
        """
        settings, queued = self.settings, self._queued
        lost = kalman.run(
            self._memory,
            self.covariance,
            self.state,
            self.noise,
            self.drag,
            acc,
            gyro,
            flying,
            self._queue,
            queued,
            settings.max_position,
            settings.max_velocity,
        )
        self.corrections += queued
        self._queued = 0
        if lost:
            self.reset()
        return lost

    def _push(self, pose: tuple[float, ...], has_attitude: float) -> None:
        if self._queued >= QUEUE_LENGTH:
            self.rejected += 1
            return
        settings = self.settings
        self._queue[self._queued] = (
            *pose,
            settings.position_deviation,
            settings.attitude_deviation,
            has_attitude,
        )
        self._queued += 1

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
