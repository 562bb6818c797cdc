"""The simulated drone's inertial sensors: noise, range, and the firmware's low-pass filters.

The filters are those of bitcraze/crazyflie-firmware 2026.08 (``sensors_bmi088_bmp3xx.c``): second-order
Butterworth, 80 Hz for the gyro and 30 Hz for the accelerometer, sampled at 1 kHz. Their delay (2.8 and
7.5 ms at low frequency) is part of the vehicle. The firmware removes the gyro's bias at start; a bias that
develops afterwards can be injected.
"""

import math

import numpy as np

from onboard.arrays import FloatArray, Vector
from onboard.jit import kept
from onboard.vehicle import Sensing

GYRO_CUTOFF_HZ = 80.0
ACCELEROMETER_CUTOFF_HZ = 30.0
SAMPLE_RATE_HZ = 1000.0
_BLOCK = 1000


def butterworth(cutoff_hz: float, sample_rate_hz: float) -> FloatArray:
    """Coefficients b0, b1, b2, a1, a2 of a second-order Butterworth low-pass (bilinear transform)."""
    k = math.tan(math.pi * cutoff_hz / sample_rate_hz)
    norm = 1.0 + math.sqrt(2.0) * k + k * k
    b0 = k * k / norm
    return np.array([b0, 2.0 * b0, b0, 2.0 * (k * k - 1.0) / norm, (1.0 - math.sqrt(2.0) * k + k * k) / norm])


@kept()
def sense(
    truth: FloatArray,
    noise: FloatArray,
    offset: float,
    limit: float,
    filter_: FloatArray,
    memory: FloatArray,
    out: FloatArray,
) -> None:
    """One sample of a three-axis sensor, in place.

    Args:
        truth: true value (3,).
        noise: noise and bias to add: row(s) of a block, from index `offset` of the flat array.
        offset: first element of `noise` to use.
        limit: range, +-.
        filter_: coefficients of :func:`butterworth`.
        memory: filter memory (3, 2).
        out: filtered value (3,).
    """
    start = int(offset)
    for i in range(3):
        raw = min(limit, max(-limit, truth[i] + noise[start + i]))
        # direct form II, transposed
        y = filter_[0] * raw + memory[i, 0]
        memory[i, 0] = filter_[1] * raw - filter_[3] * y + memory[i, 1]
        memory[i, 1] = filter_[2] * raw - filter_[4] * y
        out[i] = y


class InertialSensors:
    """Accelerometer and rate gyro of one drone; call :meth:`sample` once a ms.

    Attributes:
        acc: filtered specific force (3,), m/s2, body.
        gyro: filtered body rate (3,), rad/s.
        gyro_bias: injected bias (3,), rad/s; set before it samples.
    """

    def __init__(self, sensing: Sensing, rng: np.random.Generator) -> None:
        self.acc: FloatArray = np.zeros(3)
        self.gyro: FloatArray = np.zeros(3)
        self.gyro_bias: FloatArray = np.zeros(3)
        self._gyro_offset: FloatArray = np.zeros(3)
        self._acc_offset: FloatArray = np.zeros(3)
        self._sensing = sensing
        self._rng = rng
        self._acc_filter = butterworth(ACCELEROMETER_CUTOFF_HZ, SAMPLE_RATE_HZ)
        self._gyro_filter = butterworth(GYRO_CUTOFF_HZ, SAMPLE_RATE_HZ)
        self._acc_memory: FloatArray = np.zeros((3, 2))
        self._gyro_memory: FloatArray = np.zeros((3, 2))
        self._index = _BLOCK
        self._acc_noise: FloatArray = np.empty(0)
        self._gyro_noise: FloatArray = np.empty(0)

    def settle(self, specific_force: FloatArray) -> None:
        """Start the filters at rest under `specific_force` (m/s2, body), as after a calibrated boot."""
        for value, memory, c, out in (
            (specific_force, self._acc_memory, self._acc_filter, self.acc),
            (np.zeros(3), self._gyro_memory, self._gyro_filter, self.gyro),
        ):
            memory[:, 1] = (c[2] - c[4]) * value
            memory[:, 0] = (1.0 - c[0]) * value
            out[:] = value

    def sample(self, specific_force: FloatArray, rates: FloatArray) -> None:
        """Measure the true specific force (3,) [m/s2] and body rates (3,) [rad/s]."""
        if self._index >= _BLOCK:
            self._draw()
        offset = 3 * self._index
        self._index += 1
        s = self._sensing
        sense(
            specific_force,
            self._acc_noise,
            offset,
            s.accelerometer_range.value,
            self._acc_filter,
            self._acc_memory,
            self.acc,
        )
        sense(
            rates,
            self._gyro_noise,
            offset,
            s.gyro_range.value,
            self._gyro_filter,
            self._gyro_memory,
            self.gyro,
        )

    def offset(self, gyro: Vector | None = None, acc: Vector | None = None) -> None:
        """From the next sample on the gyro shows so much too much [rad/s], the accelerometer so much [m/s2];
        None leaves it as it is."""
        for noise, offset, wanted in (
            (self._gyro_noise, self._gyro_offset, gyro),
            (self._acc_noise, self._acc_offset, acc),
        ):
            if wanted is not None:
                noise += np.tile(np.array(wanted) - offset, noise.size // 3)
                offset[:] = wanted

    def _draw(self) -> None:
        noise = self._rng.standard_normal((2, _BLOCK, 3))
        self._acc_noise = (noise[0] * self._sensing.accelerometer_noise.value + self._acc_offset).ravel()
        self._gyro_noise = (
            noise[1] * self._sensing.gyro_noise.value + self.gyro_bias + self._gyro_offset
        ).ravel()
        self._index = 0
