"""Phase and delay margin of the attitude loop: how much more lag or delay the control law stands.

The loop is opened at the moments that the law asks for, linear about the hover, one body axis at a time::

    L(s) = (kr P(s) H(s) + kw s) G(s) C(s) exp(-s LOOP_DELAY) / ((T s + 1) J s^2)

with the position loop's part in the wanted tilt, P = 1 + kd / (m s) + kp / (m s^2) + ki / (m s^3) about b_x
and b_y and 1 about b_z, the firmware's low-pass of the gyro G, which the attitude estimate follows too, and
the lead C as it is computed (:func:`onboard.controller.lead_moments`). The law's attitude is that of the
firmware's filter, which stands still for ESTIMATE_PERIOD between two predictions, 5 ms old in the mean (a
zero-order hold, H); its rate is the gyro's of the step before.

T is the mean of the motors' time constants of rising and of falling thrust. One of the motors that make a
moment rises while the other falls: for 50 ms up and 150 ms down the describing function of such a pair has up
to 2.5 deg less lag than T says, and its size within 5 % of it (``tests/onboard/test_attitude_margins.py``).
"""

import math
from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from onboard.arrays import FloatArray
from onboard.controller import ControllerGains, controller_gains
from onboard.follower import CONTROL_PERIOD_MS
from onboard.vehicle.model import Vehicle

GYRO_CUTOFF_HZ = 80.0
"""Second-order Butterworth low-pass of the gyro (crazyflie-firmware 2026.08, ``sensors_bmi088_bmp3xx.c``)."""

LOOP_DELAY = 0.002
"""s, from a sample of the gyro to the motors' new command: state of the step before, law at 500 Hz."""

ESTIMATE_PERIOD = 0.01
"""s between two predictions of the filter (crazyflie-firmware 2026.08, ``estimator_kalman.c``)."""

PHASE_LIMIT_DEG = 35.0
DELAY_LIMIT = 0.015
"""deg and s: with less, what a real drone adds (delays, flexible arms, a wrong inertia) may lose the loop."""

LAGS = (0.05, 0.075, 0.1, 0.125, 0.15)
"""s: motor lags, from the shortest to the longest that was measured on a Crazyflie (errata 2, bench 1.2)."""

_FREQUENCIES = np.geomspace(1.0, 300.0, 1000)
"""rad/s, where the loop is looked at: all crossovers of vehicles of this size lie far inside."""

ComplexArray: TypeAlias = NDArray[np.complexfloating]


class AttitudeMargins(NamedTuple):
    """Margins of the worst of the three body axes.

    Attributes:
        phase_deg: deg of lag that the loop stands; negative: it is unstable as it is.
        delay: s of delay that it stands; 0 when it is unstable.
    """

    phase_deg: float
    delay: float

    @property
    def suffice(self) -> bool:
        """Whether both reach their limits."""
        return self.phase_deg >= PHASE_LIMIT_DEG and self.delay >= DELAY_LIMIT


def attitude_margins(
    gains: ControllerGains, lag_up: float, lag_down: float, delay: float = 0.0
) -> AttitudeMargins:
    """Margins of the attitude loop that a law closes with motors of these lags.

    Args:
        gains: of the law, with the vehicle's mass and inertia.
        lag_up, lag_down: s, time constants of rising and of falling thrust.
        delay: s, of the loop beyond :data:`LOOP_DELAY`.
    """
    s = 1j * _FREQUENCIES
    motors = 1.0 / (0.5 * (lag_up + lag_down) * s + 1.0)
    tilt, yaw = _tilt_feedback(s, gains), gains.kr_z * _held(s) + gains.kw_z * s
    axes = ((tilt, gains.inertia_xx), (tilt, gains.inertia_yy), (yaw, gains.inertia_zz))
    shared = _gyro(s) * _lead(s, gains) * motors * np.exp(-s * LOOP_DELAY)
    return _least([_margins(feedback * shared / (inertia * s**2), delay) for feedback, inertia in axes])


def vehicle_margins(vehicle: Vehicle) -> AttitudeMargins:
    """Margins of a vehicle with the law that its file asks for.

    Of its effects ``motor_lag``, ``motor_lag_asymmetry`` and ``command_delay`` count.
    """
    up, down = vehicle.motors.time_constant_up.value, vehicle.motors.time_constant_down.value
    effects = {effect.name: effect.values() for effect in vehicle.effects}
    scale = effects["motor_lag"]["scale"] if "motor_lag" in effects else 1.0
    ratio = effects["motor_lag_asymmetry"]["ratio"] if "motor_lag_asymmetry" in effects else 1.0
    apart = math.sqrt(ratio)
    gains, delay = controller_gains(vehicle), command_delay(vehicle)
    return attitude_margins(gains, scale * up / apart, scale * down * apart, delay)


def margins_by_lag(vehicle: Vehicle) -> dict[float, AttitudeMargins]:
    """Margins of a vehicle if its motors had each lag of :data:`LAGS`; its ``command_delay`` stays."""
    gains, delay = controller_gains(vehicle), command_delay(vehicle)
    return {lag: attitude_margins(gains, lag, lag, delay) for lag in LAGS}


def command_delay(vehicle: Vehicle) -> float:
    """s, the effect's; 0 without it."""
    return sum(effect.values()["delay"] for effect in vehicle.effects if effect.name == "command_delay")


def _least(cases: list[AttitudeMargins]) -> AttitudeMargins:
    return AttitudeMargins(min(case.phase_deg for case in cases), min(case.delay for case in cases))


def _tilt_feedback(s: ComplexArray, gains: ControllerGains) -> ComplexArray:
    """Moment over angle about b_x or b_y (N m/rad): a tilt is also answered by way of the position."""
    m = gains.mass
    wanted = 1.0 + gains.kd_xy / (m * s) + gains.kp_xy / (m * s**2) + gains.ki_xy / (m * s**3)
    return gains.kr_xy * wanted * _held(s) + gains.kw_xy * s


def _held(s: ComplexArray) -> ComplexArray:
    """An estimate that stands still between two predictions."""
    x = s * ESTIMATE_PERIOD
    return np.asarray((1.0 - np.exp(-x)) / x)


def _gyro(s: ComplexArray) -> ComplexArray:
    x = s / (2.0 * math.pi * GYRO_CUTOFF_HZ)
    return np.asarray(1.0 / (1.0 + math.sqrt(2.0) * x + x * x))


def _lead(s: ComplexArray, gains: ControllerGains) -> ComplexArray:
    """The lead's difference equations; `back` is one step back."""
    dt = CONTROL_PERIOD_MS / 1000.0
    back = np.exp(-s * dt)
    share = dt / (gains.lead_pole + dt)
    lagged = share / (1.0 - (1.0 - share) * back)
    gain = (gains.lead_zero - gains.lead_pole) / (gains.lead_pole + dt)
    return np.asarray(1.0 + gain * (1.0 - back * lagged))


def _margins(loop: ComplexArray, delay: float) -> AttitudeMargins:
    """Margins of an open loop where its size crosses 1; a loop that does not stands everything.

    Args:
        loop: without `delay`, which may turn it by more than its phase is known to be within.
        delay: s, further delay.
    """
    size = np.log(np.abs(loop))
    phase = _unwrapped(loop)
    cases = [AttitudeMargins(math.inf, math.inf)]
    for i in np.flatnonzero(np.diff(np.sign(size))):
        share = size[i] / (size[i] - size[i + 1])
        left = math.pi + float(phase[i] + share * (phase[i + 1] - phase[i]))
        at = float(_FREQUENCIES[i] + share * (_FREQUENCIES[i + 1] - _FREQUENCIES[i]))
        left -= at * delay
        cases.append(AttitudeMargins(math.degrees(left), max(left, 0.0) / at))
    return _least(cases)


def _unwrapped(loop: ComplexArray) -> FloatArray:
    """Phase (rad) without jumps; the fastest one, far above the crossover, between -3 pi and -pi."""
    phase = np.unwrap(np.angle(loop))
    turns = np.floor((phase[-1] + math.pi) / (2.0 * math.pi)) + 1.0
    return np.asarray(phase - 2.0 * math.pi * turns)
