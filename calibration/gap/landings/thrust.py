"""What the motors were told, as thrusts on the steps of the simulation."""

import numpy as np

from calibration.flights import Flight
from calibration.gap.data.samples import samples_of
from calibration.gap.landings.kernels import DT
from onboard.arrays import FloatArray
from onboard.battery import FULL_RATIO, thrust_from_voltage
from onboard.vehicle import Vehicle

_MOTORS = ("m1", "m2", "m3", "m4")
_THRUSTS = ("f1", "f2", "f3", "f4")


def commanded_thrusts(flight: Flight, vehicle: Vehicle) -> tuple[FloatArray, FloatArray] | None:
    """Times (n,) (s) and thrusts (n, 4) (N) that the motors were told; None without commands.

    Commanded thrusts are taken where they were logged (their battery compensation is then taken as perfect);
    else PWM and battery voltage go through the vehicle's thrust map.
    """
    if flight.has(*_THRUSTS):
        return flight.series(*_THRUSTS)
    pwm = samples_of(flight, *_MOTORS, clock="motors_drone_time")
    volts = samples_of(flight, "vbat")
    if pwm is None or volts is None:
        return None
    supply = np.interp(pwm.t, volts.t, volts.values[:, 0])
    thrust_map = vehicle.motors.thrust_map_compiled()
    at_motor = np.clip(pwm.values / FULL_RATIO, 0.0, 1.0) * supply[:, None]
    thrust = np.array([[thrust_from_voltage(thrust_map, float(v)) for v in row] for row in at_motor])
    return pwm.t, thrust


def on_steps(times: FloatArray, thrusts: FloatArray, start: float, steps: int) -> FloatArray:
    """Thrusts (N, (steps, 4)) that hold in each step of 1 ms from `start` (s) on: the last that was told."""
    at = start + DT * (np.arange(steps) + 0.5)
    row = np.searchsorted(times, at, side="right") - 1
    return np.ascontiguousarray(thrusts[np.clip(row, 0, len(times) - 1)])
