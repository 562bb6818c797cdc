"""Vibration of a hover: what gyro and accelerometer show above 30 Hz, and where the rotors' lines would be.

Logs come at 100 Hz, so that a rotor of some 300 Hz shows folded to |f - k 100 Hz|, behind the firmware's
filters (80 Hz gyro, 30 Hz accelerometer). Where its line folds to is known only as well as its speed:
w = sqrt(F / k_T), k_T of the vehicle file. Power spectra: Welch (1967), Hann windows of 1 s.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy.signal import butter, freqz, welch

from calibration.measurement import Estimate
from onboard.arrays import FloatArray
from onboard.vehicle import Vehicle
from perchhw.hover_check.windows import CheckWindows

ACCELEROMETER_CUTOFF_HZ = 30.0
"""As :data:`perchhw.hover_check.lag.GYRO_CUTOFF_HZ`."""
BAND_HZ: Final = (30.0, 50.0)
"""Above what the controller moves, up to half of the log's rate."""
_LOG_HZ, _SENSOR_HZ = 100.0, 1000.0


@dataclass(frozen=True)
class RotorLine:
    """Where a rotor's line is.

    Attributes:
        rate_hz: of the rotor, by the vehicle file, and its standard uncertainty.
        folded_hz: where a log of 100 Hz shows it.
        told: whether that place is known within 5 Hz.
        gyro: rad/s rms within 2 Hz of that place; None where it is not known.
    """

    rate_hz: float
    sigma_hz: float
    folded_hz: float
    told: bool
    gyro: float | None


@dataclass(frozen=True)
class Vibration:
    """Vibration of a hover.

    Attributes:
        gyro, accelerometer: rms of all axes in the band, rad/s and m/s2.
        rotors: a line a motor, M1 first; empty where the file has no thrust coefficient.
    """

    gyro: Estimate
    accelerometer: Estimate
    rotors: tuple[RotorLine, ...]


def vibration(windows: CheckWindows, vehicle: Vehicle, each: FloatArray) -> Vibration:
    """Spectra of the hover of a check; `each` is the thrust of motors 1 to 4 in N.

    Raises:
        RecordTooShort: nothing of gyro or accelerometer.
    """
    axes = (("rates", ("gx", "gy", "gz")), ("acceleration", ("ax", "ay", "az")))
    rates, forces = windows.on_grid(windows.hover, 1.0 / _LOG_HZ, *axes)
    seconds = len(rates) / _LOG_HZ
    frequencies, gyro = _spectrum(rates)
    _, accelerometer = _spectrum(forces)
    band = (frequencies >= BAND_HZ[0]) & (frequencies <= BAND_HZ[1])
    return Vibration(
        gyro=_rms(gyro[band], seconds, "rad/s"),
        accelerometer=_rms(accelerometer[band], seconds, "m/s2"),
        rotors=_rotors(vehicle, each, frequencies, gyro),
    )


def noise_in_band(sigma: float, cutoff_hz: float) -> float:
    """What white noise of a three-axis sensor (`sigma` of one 1 kHz sample) leaves in the band, rms, behind a
    second-order Butterworth filter and folded by a log of 100 Hz."""
    b, a = butter(2, cutoff_hz, fs=_SENSOR_HZ)
    frequencies = np.arange(0.25, 0.5 * _SENSOR_HZ, 0.5)
    _, response = freqz(b, a, worN=frequencies, fs=_SENSOR_HZ)
    seen = folded(frequencies) >= BAND_HZ[0]
    share = float((np.abs(response[seen]) ** 2).sum()) / len(frequencies)
    return sigma * float(np.sqrt(3.0 * share))


def folded(frequencies: FloatArray) -> FloatArray:
    """Where a log of 100 Hz shows these frequencies, Hz."""
    return np.abs(frequencies - _LOG_HZ * np.round(frequencies / _LOG_HZ))


def _spectrum(values: FloatArray) -> tuple[FloatArray, FloatArray]:
    """One-sided power density of all axes together, (frequencies,)."""
    frequencies, power = welch(values, _LOG_HZ, nperseg=min(100, len(values)), axis=0)
    return frequencies, power.sum(axis=1)


def _rms(power: FloatArray, seconds: float, unit: str) -> Estimate:
    """Of densities each 1 Hz apart; by 2 B T degrees of freedom an axis (Bendat and Piersol 2010, 8.3)."""
    value = float(np.sqrt(power.sum() * 1.0))
    freedom = 3.0 * 2.0 * (BAND_HZ[1] - BAND_HZ[0]) * seconds
    return Estimate(value, unit, value / np.sqrt(2.0 * freedom))


def _rotors(
    vehicle: Vehicle, each: FloatArray, frequencies: FloatArray, gyro: FloatArray
) -> tuple[RotorLine, ...]:
    coefficient = vehicle.motors.thrust_coefficient
    if coefficient is None:
        return ()
    relative = 0.5 * coefficient.sigma / coefficient.value
    lines = []
    for thrust in each.tolist():
        rate = float(np.sqrt(max(thrust, 0.0) / coefficient.value)) / (2.0 * np.pi)
        place = float(folded(np.array([rate]))[0])
        told = relative * rate <= 5.0
        near = np.abs(frequencies - place) <= 2.0
        level = float(np.sqrt(gyro[near].sum())) if told else None
        lines.append(RotorLine(rate, relative * rate, place, told, level))
    return tuple(lines)
