"""How quickly the motors follow: the doublets' commands through the vehicle file's lag, against the gyro.

    dF_i/dt = (F*_i - F_i) / (s tau),  tau: up or down, as the file has them
    w_y' = -arm_x (F1 - F2 - F3 + F4) / I_yy,   w_x' = arm_y (F3 + F4 - F1 - F2) / I_xx

s is sought: 1 where the motors are as quick as the file says. The modelled rate goes through the firmware's
80 Hz filter of the gyro and is fitted window by window with a free gain (arm over inertia) and a free line
(what it began with, and a constant moment), so that neither inertia nor centre of mass are mistaken for lag.
"""

import numpy as np
from scipy.signal import butter, lfilter

from calibration.measurement import Estimate
from onboard.arrays import FloatArray
from onboard.vehicle import Vehicle
from perchhw.hover_check.thrust import thrusts_of
from perchhw.hover_check.windows import MOTORS, CheckWindows, RecordTooShort

GYRO_CUTOFF_HZ = 80.0
"""Second-order Butterworth (bitcraze/crazyflie-firmware 2026.08, ``sensors_bmi088_bmp3xx.c``)."""
SCALES = np.geomspace(0.4, 3.0, 25)
_DT, _FINE = 0.01, 5
SAMPLING = 0.2
"""Half of what the result may be off where commands are seen each 10 ms as they are at that instant (firmware
without our law): a step of theirs may have come at any time in between. In the simulation 0.8 to 1.05 was
found for 1 from instants, 1.05 from the means over 10 ms that our law logs."""
_WINDOW_S = 0.55
"""Half of what a doublet takes: each has one of the two quick turns."""


def motor_lag(windows: CheckWindows, vehicle: Vehicle) -> Estimate:
    """Time constants of the motors over those of the vehicle file; the error is a jackknife over windows.

    Raises:
        RecordTooShort: no doublets in the record.
    """
    asked = (("rates", ("gx", "gy")), ("motors", MOTORS))
    rates, pwm = windows.on_grid(windows.doublets, _DT, *asked)
    _, power = windows.columns("power", windows.doublets, "vbat")
    count = len(rates)
    width = round(_WINDOW_S / _DT)
    if count < 6 * width:
        raise RecordTooShort(f"{windows.run.folder}: has too few doublets; fly the check again")
    volts = np.full(count, power.mean())
    bits = round(vehicle.motors.pwm_bits.value)
    wanted = thrusts_of(vehicle.motors.thrust_map_compiled(), pwm, volts, bits)
    modelled = _modelled_rates(wanted, vehicle)
    errors = _window_errors(modelled, rates, width)
    return _likeliest(errors)


def _modelled_rates(wanted: FloatArray, vehicle: Vehicle) -> FloatArray:
    """Rates about x and y (rad/s) of commands (n, 4) in N, for each of the scales: (scales, n, 2)."""
    fine = np.linspace(0.0, len(wanted) - 1.0, _FINE * (len(wanted) - 1) + 1)
    steps = np.column_stack([np.interp(fine, np.arange(len(wanted)), column) for column in wanted.T])
    dt = _DT / _FINE
    up = dt / (SCALES[:, None] * vehicle.motors.time_constant_up.value)
    down = dt / (SCALES[:, None] * vehicle.motors.time_constant_down.value)
    thrust = np.tile(steps[0], (len(SCALES), 1))
    moments = np.empty((len(SCALES), len(steps), 2))
    arm_x, arm_y = vehicle.body.arm_x.value, vehicle.body.arm_y.value
    for k, step in enumerate(steps):
        off = step - thrust
        thrust = thrust + np.where(off > 0.0, up, down) * off
        m1, m2, m3, m4 = thrust.T
        moments[:, k, 0] = arm_y * (m3 + m4 - m1 - m2) / vehicle.body.inertia_xx.value
        moments[:, k, 1] = arm_x * (m2 + m3 - m1 - m4) / vehicle.body.inertia_yy.value
    b, a = butter(2, GYRO_CUTOFF_HZ, fs=1.0 / dt)
    rates = lfilter(b, a, np.cumsum(moments, axis=1) * dt, axis=1)
    return np.asarray(rates[:, ::_FINE])


def _window_errors(modelled: FloatArray, measured: FloatArray, width: int) -> FloatArray:
    """Sum of squares left by gain and line, for each scale and window: (scales, windows)."""
    count = len(measured) // width
    line = np.column_stack([np.ones(width), np.arange(width) - 0.5 * width])
    # What is orthogonal to every line: then only the gain is left to fit.
    apart = np.eye(width) - line @ np.linalg.pinv(line)
    shape = (count, width, 2)
    turned = np.einsum("ij,wja->wia", apart, measured[: count * width].reshape(shape))
    model = np.einsum("ij,swja->swia", apart, modelled[:, : count * width].reshape(len(SCALES), *shape))
    gain = (model * turned).sum(axis=(1, 2)) / (model**2).sum(axis=(1, 2))
    return np.asarray(((turned - gain[:, None, None] * model) ** 2).sum(axis=(2, 3)))


def _likeliest(errors: FloatArray) -> Estimate:
    """The scale of the least error, and the jackknife over windows (Efron and Stein 1981)."""
    count = errors.shape[1]
    left_out = np.array([_least(np.delete(errors, w, axis=1).sum(axis=1)) for w in range(count)])
    error = float(np.sqrt((count - 1) / count * ((left_out - left_out.mean()) ** 2).sum()))
    sigma = float(np.hypot(error, SAMPLING / np.sqrt(3.0)))
    return Estimate(_least(errors.sum(axis=1)), "1", sigma, half_width=SAMPLING)


def _least(errors: FloatArray) -> float:
    """Scale at the foot of the parabola through the three least errors about the grid's least."""
    at = int(np.clip(np.argmin(errors), 1, len(errors) - 2))
    a, b, _ = np.polyfit(np.log(SCALES[at - 1 : at + 2]), errors[at - 1 : at + 2], 2)
    foot = -0.5 * b / a if a > 0.0 else np.log(SCALES[at])
    return float(np.exp(np.clip(foot, np.log(SCALES[0]), np.log(SCALES[-1]))))
