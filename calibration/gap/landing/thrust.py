"""What the motors were told, as thrusts on the steps of the simulation."""

import numpy as np

from calibration.flights import Flight
from calibration.gap.landing.kernels import DT
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
    if not flight.has(*_MOTORS) or not flight.has("vbat"):
        return None
    t, pwm = _commands_on_clock(flight)
    t_volts, volts = flight.series("vbat")
    supply = np.interp(t, t_volts, volts[:, 0])
    thrust_map = vehicle.motors.thrust_map_compiled()
    at_motor = np.clip(pwm / FULL_RATIO, 0.0, 1.0) * supply[:, None]
    thrust = np.array([[thrust_from_voltage(thrust_map, float(v)) for v in row] for row in at_motor])
    return t, thrust


def _commands_on_clock(flight: Flight) -> tuple[FloatArray, FloatArray]:
    """PWM by the drone's own clock where the log has it, as the gyro (:func:`segments.gyro_on_clock`)."""
    if not flight.has("motors_drone_time"):
        return flight.series(*_MOTORS)
    host, values = flight.series("motors_drone_time", *_MOTORS)
    return values[:, 0] + float(np.min(host - values[:, 0])), values[:, 1:]


def on_steps(times: FloatArray, thrusts: FloatArray, start: float, steps: int) -> FloatArray:
    """Thrusts (N, (steps, 4)) that hold in each step of 1 ms from `start` (s) on: the last that was told."""
    at = start + DT * (np.arange(steps) + 0.5)
    row = np.searchsorted(times, at, side="right") - 1
    return np.ascontiguousarray(thrusts[np.clip(row, 0, len(times) - 1)])
