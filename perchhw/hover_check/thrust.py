"""Hover: what the thrust map gives the commands against the weight, motor by motor, and the battery's sag.

Standing still, the four true thrusts carry the weight and leave no moment:

    sum F_i = m g,   F1 = F2 = F3 = F4   (arms alike, centre of mass in the middle)

so the thrust that the map gives motor i's command, over the mean of the middle two, is how much weaker than
these that motor with its propeller is; and four times that mean is the weight, whatever one weak motor asks
for. A centre of mass beside the middle makes two neighbours work harder; a weak motor works harder alone,
because the yaw must balance too: F1 + F3 = F2 + F4.
"""

from dataclasses import dataclass

import numpy as np

from calibration.measurement import Estimate
from onboard.arrays import FloatArray
from onboard.battery import FULL_RATIO, quantise_pwm, thrust_from_voltage
from onboard.gravity import GRAVITY
from onboard.thrust_map import ThrustMap
from onboard.vehicle import Vehicle
from perchhw.hover_check.windows import MOTORS, CheckWindows, mean_of

ADC_V = 0.01
"""V, standard uncertainty of the drone's voltage reading. Ours, until a lab has held it to a voltmeter."""
_BLOCKS = 8


@dataclass(frozen=True)
class HoverThrust:
    """What a hover says of thrust and battery.

    Attributes:
        thrust: by map and commands, over the weight; 1 where mass and map are the drone's.
        shares: thrust of motors 1 to 4 by the map, over the mean of the middle two.
        resistance: ohm, from the fall of the voltage at take-off, by the file's current per newton.
        each: N, (4,), mean thrusts by the map.
        voltage: V, mean.
    """

    thrust: Estimate
    shares: tuple[Estimate, Estimate, Estimate, Estimate]
    resistance: Estimate
    each: FloatArray
    voltage: float


def hover_thrust(windows: CheckWindows, vehicle: Vehicle) -> HoverThrust:
    """Estimates from the hover of a check.

    Raises:
        RecordTooShort: no motor commands or no voltage.
    """
    t, pwm = windows.columns("motors", windows.hover, *MOTORS)
    t_power, power = windows.columns("power", windows.hover, "vbat")
    # The voltage's noise averages out over a second, its fall does not matter within one.
    voltage = np.interp(t, t_power, _smoothed(power[:, 0]))
    thrust_map = vehicle.motors.thrust_map_compiled()
    bits = round(vehicle.motors.pwm_bits.value)
    thrusts = thrusts_of(thrust_map, pwm, voltage, bits)
    weight = vehicle.body.mass.value * GRAVITY
    middle = np.argsort(thrusts.mean(axis=0))[1:3]
    typical = thrusts[:, middle].mean(axis=1)
    mean, error = mean_of(4.0 * typical / weight, _BLOCKS)
    higher = thrusts_of(thrust_map, pwm, voltage + ADC_V, bits)[:, middle]
    off = 4.0 * float(higher.mean()) / weight - mean
    shares = thrusts / float(typical.mean())
    m1, m2, m3, m4 = (_estimate(*mean_of(column, _BLOCKS), "1") for column in shares.T)
    return HoverThrust(
        thrust=_estimate(mean, float(np.hypot(error, off)), "1"),
        shares=(m1, m2, m3, m4),
        resistance=_resistance(windows, vehicle, float(thrusts.sum(axis=1).mean())),
        each=thrusts.mean(axis=0),
        voltage=float(voltage.mean()),
    )


def thrusts_of(thrust_map: ThrustMap, pwm: FloatArray, voltage: FloatArray, bits: int) -> FloatArray:
    """Settled thrusts (N), shape (n, 4), of 16-bit commands (n, 4) at battery voltages (n,)."""
    thrusts = np.empty_like(pwm)
    for row, (commands, volts) in enumerate(zip(pwm, voltage, strict=True)):
        for motor, command in enumerate(commands):
            duty = quantise_pwm(command / FULL_RATIO, bits)
            thrusts[row, motor] = thrust_from_voltage(thrust_map, duty * volts)
    return thrusts


def _resistance(windows: CheckWindows, vehicle: Vehicle, thrust: float) -> Estimate:
    """Voltage at rest less that of the hover, carried back to take-off, over the current of the hover.

    V = E - R I, I = c sum F (the file's c); the fall of E is the slope of the hover's voltage.
    """
    _, rest = windows.columns("power", windows.rest, "vbat")
    t, power = windows.columns("power", windows.hover, "vbat")
    fall, at_begin = np.polyfit(t - windows.hover[0], power[:, 0], 1)
    aloft = windows.hover[0] - windows.rest[1]
    loaded = float(at_begin) - float(fall) * aloft
    scatter = float(np.std(power[:, 0] - np.polyval([fall, at_begin], t - windows.hover[0])))
    error = np.hypot(2.0 * scatter / np.sqrt(len(t)), np.std(rest) / np.sqrt(len(rest)))
    current = vehicle.battery.motor_current_per_newton.value * thrust
    return _estimate((float(rest.mean()) - loaded) / current, float(np.hypot(error, ADC_V)) / current, "ohm")


def _estimate(value: float, error: float, unit: str) -> Estimate:
    return Estimate(value, unit, error, _BLOCKS - 1)


def _smoothed(voltage: FloatArray) -> FloatArray:
    """Mean over a second (100 samples) about each sample, (n,)."""
    width = min(101, 2 * (len(voltage) // 2) - 1)
    padded = np.pad(voltage, width // 2, mode="edge")
    return np.convolve(padded, np.full(width, 1.0 / width), mode="valid")
