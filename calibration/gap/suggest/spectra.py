"""Noise of the signals on real flights as spectra, and the weighing of a difference by them.

For stationary noise the log-likelihood ratio of two means that differ by r is half the sum over frequencies
of |r|^2 over the spectrum (Whittle, J. Royal Stat. Soc. B 15, 1953).
"""

import math

import numpy as np

from calibration.gap.suggest.simulate import FORCE_DISTURBANCE, TORQUE_DISTURBANCE
from onboard.arrays import FloatArray
from onboard.gravity import GRAVITY

GYRO_NOISE, ACCELEROMETER_NOISE = 0.01, 0.05
"""rad/s and m/s2, a sample."""

POSITION_NOISE, ATTITUDE_NOISE = 2e-4, 3e-3
"""m and rad, a sample of motion capture."""

VOLTAGE_NOISE = 0.01
"""V, a sample."""

_TORQUE = (TORQUE_DISTURBANCE, (3.0, 2.0))
"""(rad/s2, s): quick disturbances, and the slow torque of real flights that nothing explains."""
_FORCE = (FORCE_DISTURBANCE,)
_VOLTAGE = ((0.02, 10.0),)


def _coloured(frequency: FloatArray, parts: tuple[tuple[float, float], ...], dt: float) -> FloatArray:
    """Spectrum, per sample, of a sum of Ornstein-Uhlenbeck processes (standard deviation, s)."""
    total = np.zeros_like(frequency)
    for deviation, seconds in parts:
        keep = math.exp(-dt / seconds)
        total += deviation**2 * (1.0 - keep**2) / np.abs(1.0 - keep * np.exp(-1j * frequency)) ** 2
    return total


def noise_spectra(count: int, dt: float) -> FloatArray:
    """Spectrum of every channel at the frequencies of ``numpy.fft.rfft``, per sample, shape (m, 13).

    Args:
        count: samples. dt: s between them.
    """
    frequency = np.asarray(2.0 * np.pi * np.fft.rfftfreq(count), dtype=np.float64)
    difference = np.abs(1.0 - np.exp(-1j * frequency)) ** 2 / dt**2
    one = np.ones_like(frequency)
    force = ACCELEROMETER_NOISE**2 + _coloured(frequency, _FORCE, dt)
    torque = GYRO_NOISE**2 * difference + _coloured(frequency, _TORQUE, dt)
    voltage = VOLTAGE_NOISE**2 + _coloured(frequency, _VOLTAGE, dt)
    seen_force = ACCELEROMETER_NOISE**2 + (GRAVITY * ATTITUDE_NOISE) ** 2 + POSITION_NOISE**2 * difference**2
    seen_rate = GYRO_NOISE**2 + ATTITUDE_NOISE**2 * difference
    columns = [*[force] * 3, *[torque] * 3, voltage, *[seen_force] * 3, *[seen_rate] * 3]
    return np.stack([column * one for column in columns], axis=1)


def weighed(signals: FloatArray, spectra: FloatArray) -> FloatArray:
    """Signals in units of their noise: independent numbers, the sum of whose squares is twice a
    log-likelihood ratio.

    Args:
        signals: shape (n, 13).
        spectra: from :func:`noise_spectra`.

    Returns:
        shape (2 m 13,).
    """
    count = signals.shape[0]
    parts = np.fft.rfft(signals, axis=0) / np.sqrt(count * spectra)
    # All frequencies but the first (and the last of an even count) stand for two.
    parts[1 : (count + 1) // 2] *= np.sqrt(2.0)
    return np.concatenate((parts.real.ravel(), parts.imag.ravel()))
