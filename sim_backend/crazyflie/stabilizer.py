"""From setpoint and estimate to motor ratios: position loop 100 Hz, attitude 500 Hz, motors 1 kHz.

The control law, the mixer and the battery compensation are the reference functions of :mod:`onboard`, the
ones that our firmware app implements. The rates are the firmware's (``stabilizer_types.h``). Axes that a
setpoint gives as a velocity follow a position that moves with it, at most 0.3 m ahead of the drone.
"""

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from onboard.arrays import FloatArray, Quaternion, Vector
from onboard.battery import FULL_RATIO, duty_for_thrust, quantise_pwm
from onboard.controller import ControllerGains, Wrench, controller_gains, geometric_control, lead_moments
from onboard.gravity import GRAVITY
from onboard.jit import kept
from onboard.mixer import Thrusts, mix
from onboard.rotation import body_z, euler_angles
from onboard.thrust_map import ThrustMap
from onboard.vehicle import Vehicle
from sim_backend.crazyflie.estimator import Estimator
from sim_backend.crazyflie.setpoint import Mode, Setpoint

POSITION_PERIOD_MS = 10
ATTITUDE_PERIOD_MS = 2
LEASH = 0.3
"""m: how far a position that follows a velocity setpoint may run ahead."""

# Layout of the target of the control kernel.
_POSITION, _VELOCITY, _ACCELERATION, _YAW, _RATES, _INTEGRAL, _TRACKED, _SIZE = 0, 3, 6, 9, 10, 13, 16, 19


@kept()
def control(x: FloatArray, gyro: FloatArray, target: FloatArray, gains: ControllerGains) -> Wrench:
    """Collective (N) and moments (N m) that track `target` (layout above) from filter state `x`.

    An axis whose flag at `_TRACKED` is 0 has no position or velocity error: only its acceleration acts.
    """
    p = (x[0], x[1], x[2])
    v = (x[3], x[4], x[5])
    tx = target[0] if target[16] > 0.0 else x[0]
    ty = target[1] if target[17] > 0.0 else x[1]
    tz = target[2] if target[18] > 0.0 else x[2]
    ux = target[3] if target[16] > 0.0 else x[3]
    uy = target[4] if target[17] > 0.0 else x[4]
    uz = target[5] if target[18] > 0.0 else x[5]
    return geometric_control(
        p,
        v,
        (x[6], x[7], x[8], x[9]),
        (gyro[0] - target[10], gyro[1] - target[11], gyro[2] - target[12]),
        (target[13], target[14], target[15]),
        (tx, ty, tz),
        (ux, uy, uz),
        (target[6], target[7], target[8]),
        target[9],
        gains,
    )


@kept()
def motor_ratio(thrust: float, supply: float, thrust_map: ThrustMap, thrust_min: float) -> int:
    """16-bit ratio that gives one motor `thrust` (N) at the supply voltage `supply` (V)."""
    return int(duty_for_thrust(thrust, supply, thrust_map, thrust_min) * FULL_RATIO)


@kept()
def motor_ratios(
    thrusts: Thrusts, supply: float, thrust_map: ThrustMap, thrust_min: float, ratios: NDArray[np.int64]
) -> None:
    """Ratios of the four motors, in place."""
    ratios[0] = motor_ratio(thrusts[0], supply, thrust_map, thrust_min)
    ratios[1] = motor_ratio(thrusts[1], supply, thrust_map, thrust_min)
    ratios[2] = motor_ratio(thrusts[2], supply, thrust_map, thrust_min)
    ratios[3] = motor_ratio(thrusts[3], supply, thrust_map, thrust_min)


@kept()
def applied_duties(ratios: NDArray[np.int64], duties: FloatArray) -> None:
    """What the 8-bit timers make of the ratios, in place: duties 0..1."""
    for i in range(4):
        duties[i] = quantise_pwm(ratios[i] / FULL_RATIO)


def level_out(setpoint: Setpoint) -> Setpoint:
    """The supervisor's replacement when setpoints stop coming: level, no turning, height as it was."""
    return replace(
        setpoint,
        mode_x=Mode.DISABLED,
        mode_y=Mode.DISABLED,
        mode_roll=Mode.ABSOLUTE,
        mode_pitch=Mode.ABSOLUTE,
        mode_yaw=Mode.VELOCITY,
        roll=0.0,
        pitch=0.0,
        rates=(setpoint.rates[0], setpoint.rates[1], 0.0),
    )


class Stabilizer:
    """Controller, mixer and battery compensation of one drone.

    Attributes:
        gains: of the controller.
        wrench: last (collective, tau_x, tau_y, tau_z), N and N m, as the mixer got it.
        thrusts: last thrusts asked of the motors, N.
        ratios: int64[4], 0..65535, as ``motor.m1`` to ``m4``.
    """

    def __init__(self, vehicle: Vehicle) -> None:
        body, motors = vehicle.body, vehicle.motors
        self.gains = controller_gains(vehicle)
        self.thrust_max = motors.thrust_max.value
        self.thrust_min = motors.thrust_min.value
        self.thrust_map = motors.thrust_map_compiled()
        self.arm_x, self.arm_y = body.arm_x.value, body.arm_y.value
        self.thrust_to_torque = motors.thrust_to_torque.value
        self.mass = body.mass.value
        self.wrench: Wrench = (0.0, 0.0, 0.0, 0.0)
        self.thrusts: Thrusts = (0.0, 0.0, 0.0, 0.0)
        self.ratios: NDArray[np.int64] = np.zeros(4, dtype=np.int64)
        self._lagged: Vector = (0.0, 0.0, 0.0)
        self._target: FloatArray = np.zeros(_SIZE)
        self._following = [False, False, False, False]

    def stop(self) -> None:
        """No thrust; forget integrals, leads and positions that followed velocities."""
        self._lagged = (0.0, 0.0, 0.0)
        self.wrench = self.thrusts = (0.0, 0.0, 0.0, 0.0)
        self.ratios[:] = 0
        self._target[:] = 0.0
        self._following = [False, False, False, False]

    def follow(self, tick_ms: int, setpoint: Setpoint, estimator: Estimator, gyro: FloatArray) -> None:
        """One ms of tracking `setpoint`; a null setpoint stops the motors."""
        if setpoint.is_null:
            self.stop()
            return
        if tick_ms % POSITION_PERIOD_MS == 0:
            self._set_target(setpoint, estimator)
        if tick_ms % ATTITUDE_PERIOD_MS == 0:
            self.apply(control(estimator.state, gyro, self._target, self.gains))

    def apply(self, wanted: Wrench) -> None:
        """The control law's wrench (N, N m), once every :data:`ATTITUDE_PERIOD_MS`: lead, then mixer."""
        dt = ATTITUDE_PERIOD_MS / 1000.0
        self.wrench, self._lagged = lead_moments(wanted, self._lagged, self.gains, dt)
        self.thrusts = mix(*self.wrench, self.arm_x, self.arm_y, self.thrust_to_torque, self.thrust_max)

    def drive(self, supply: float) -> None:
        """Battery compensation: ratios for the thrusts asked for, at the low-passed supply voltage (V)."""
        motor_ratios(self.thrusts, supply, self.thrust_map, self.thrust_min, self.ratios)

    def _set_target(self, setpoint: Setpoint, estimator: Estimator) -> None:
        target, dt = self._target, POSITION_PERIOD_MS / 1000.0
        here = estimator.position()
        velocity = setpoint.velocity
        roll, pitch, yaw = estimator.roll_pitch_yaw()
        if setpoint.velocity_body:
            c, s = math.cos(yaw), math.sin(yaw)
            velocity = (c * velocity[0] - s * velocity[1], s * velocity[0] + c * velocity[1], velocity[2])
        modes = (setpoint.mode_x, setpoint.mode_y, setpoint.mode_z)
        for i, mode in enumerate(modes):
            target[_TRACKED + i] = float(mode is not Mode.DISABLED)
            target[_ACCELERATION + i] = setpoint.acceleration[i] if mode is Mode.ABSOLUTE else 0.0
            target[_VELOCITY + i] = velocity[i]
            if mode is Mode.VELOCITY:
                start = target[_POSITION + i] if self._following[i] else here[i]
                moved = start + velocity[i] * dt
                target[_POSITION + i] = min(max(moved, here[i] - LEASH), here[i] + LEASH)
            else:
                target[_POSITION + i] = setpoint.position[i]
            self._following[i] = mode is Mode.VELOCITY
        self._set_heading(setpoint, yaw, dt)
        if setpoint.mode_x is Mode.DISABLED:
            self._set_tilt(setpoint, roll, pitch)
        self._integrate(here, modes, dt)

    def _set_heading(self, setpoint: Setpoint, yaw: float, dt: float) -> None:
        target = self._target
        target[_RATES : _RATES + 3] = setpoint.rates
        if setpoint.mode_quat is Mode.ABSOLUTE:
            target[_YAW] = euler_angles(setpoint.quaternion)[2]
        elif setpoint.mode_yaw is Mode.ABSOLUTE:
            target[_YAW] = setpoint.yaw
        else:
            start = float(target[_YAW]) if self._following[3] else yaw
            target[_YAW] = start + setpoint.rates[2] * dt
        self._following[3] = setpoint.mode_yaw is Mode.VELOCITY

    def _set_tilt(self, setpoint: Setpoint, roll: float, pitch: float) -> None:
        """Accelerations that tilt the body as asked; a rate mode keeps the present angle, turning by rate."""
        if setpoint.mode_roll is not Mode.VELOCITY:
            roll = setpoint.roll
        if setpoint.mode_pitch is not Mode.VELOCITY:
            pitch = setpoint.pitch
        half = (math.cos(0.5 * float(self._target[_YAW])), math.sin(0.5 * float(self._target[_YAW])))
        up = body_z(_from_euler(roll, pitch, half))
        acceleration = self._target[_ACCELERATION : _ACCELERATION + 3]
        if setpoint.mode_z is Mode.DISABLED:
            thrust = setpoint.thrust / FULL_RATIO * 4.0 * self.thrust_max
            acceleration[:] = [thrust / self.mass * part for part in up]
            acceleration[2] -= GRAVITY
        else:
            upright = max(up[2], 0.3)
            acceleration[:2] = GRAVITY * up[0] / upright, GRAVITY * up[1] / upright

    def _integrate(self, here: Vector, modes: tuple[Mode, Mode, Mode], dt: float) -> None:
        limit = self.gains.integral_limit
        for i, mode in enumerate(modes):
            if mode is Mode.DISABLED:
                continue
            error = (here[i] - float(self._target[_POSITION + i])) * dt
            if math.isfinite(error):
                total = float(self._target[_INTEGRAL + i]) + error
                self._target[_INTEGRAL + i] = min(max(total, -limit), limit)


def _from_euler(roll: float, pitch: float, half_yaw: tuple[float, float]) -> Quaternion:
    """Unit quaternion of the Z-Y-X angles, FLU (yaw as cosine and sine of its half)."""
    cz, sz = half_yaw
    cy, sy = math.cos(0.5 * pitch), math.sin(0.5 * pitch)
    cx, sx = math.cos(0.5 * roll), math.sin(0.5 * roll)
    return (
        cz * cy * sx - sz * sy * cx,
        cz * sy * cx + sz * cy * sx,
        sz * cy * cx - cz * sy * sx,
        cz * cy * cx + sz * sy * sx,
    )
