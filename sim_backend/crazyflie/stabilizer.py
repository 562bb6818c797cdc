"""The simulated drone's control loop: when the law of :mod:`onboard` runs, and what the motors get of it.

The law (:mod:`onboard.follower`, :mod:`onboard.controller`), the mixer and the battery compensation are the
reference functions of :mod:`onboard`, the ones that our firmware app implements.
"""

import numpy as np
from numpy.typing import NDArray

from onboard.arrays import FloatArray, Vector
from onboard.battery import FULL_RATIO, duty_for_thrust, quantise_pwm
from onboard.controller import Wrench, controller_gains, lead_moments
from onboard.follower import (
    CONTROL_PERIOD_MS,
    FollowerSetpoint,
    follow,
    new_follower_memory,
    track,
)
from onboard.jit import kept
from onboard.mixer import Thrusts, mix
from onboard.thrust_map import ThrustMap
from onboard.vehicle import Vehicle
from sim_backend.crazyflie.estimator import Estimator
from sim_backend.crazyflie.setpoint import Mode, Setpoint

__all__ = [
    "CONTROL_PERIOD_MS",
    "Stabilizer",
    "applied_duties",
    "level_out",
    "motor_ratio",
    "motor_ratios",
]


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
    return setpoint._replace(
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
        self.ratios: NDArray[np.int64] = np.zeros(4, dtype=np.int64)
        self.stop()

    def stop(self) -> None:
        """No thrust; forget integrals, leads and positions that followed velocities."""
        self.wrench: Wrench = (0.0, 0.0, 0.0, 0.0)
        self.thrusts: Thrusts = (0.0, 0.0, 0.0, 0.0)
        self.ratios[:] = 0
        self._memory = new_follower_memory()
        self._lagged: Vector = (0.0, 0.0, 0.0)

    def follow(
        self, tick_ms: int, setpoint: Setpoint, set_at: int, estimator: Estimator, gyro: FloatArray
    ) -> None:
        """One ms of tracking `setpoint`, of the ms `set_at`; a null setpoint stops the motors."""
        if setpoint.is_null:
            self.stop()
            return
        if tick_ms % CONTROL_PERIOD_MS == 0:
            position, quaternion = estimator.position(), estimator.quaternion()
            asked = _asked(setpoint, tick_ms - set_at)
            follow(self._memory, asked, position, quaternion, self.gains, self.thrust_max)
            x = estimator.state
            self.apply(track(self._memory, x[0:3], x[3:6], x[6:10], gyro, self.gains))

    def apply(self, wanted: Wrench) -> None:
        """The control law's wrench (N, N m), once every :data:`CONTROL_PERIOD_MS`: lead, then mixer."""
        dt = CONTROL_PERIOD_MS / 1000.0
        self.wrench, self._lagged = lead_moments(wanted, self._lagged, self.gains, dt)
        self.thrusts = mix(*self.wrench, self.arm_x, self.arm_y, self.thrust_to_torque, self.thrust_max)

    def drive(self, supply: float) -> None:
        """Battery compensation: ratios for the thrusts asked for, at the low-passed supply voltage (V)."""
        motor_ratios(self.thrusts, supply, self.thrust_map, self.thrust_min, self.ratios)


def _asked(setpoint: Setpoint, age_ms: int) -> FollowerSetpoint:
    """A firmware's setpoint as the law takes it."""
    return FollowerSetpoint(
        modes=(int(setpoint.mode_x), int(setpoint.mode_y), int(setpoint.mode_z)),
        mode_roll=int(setpoint.mode_roll),
        mode_pitch=int(setpoint.mode_pitch),
        mode_yaw=int(setpoint.mode_yaw),
        mode_quaternion=int(setpoint.mode_quat),
        velocity_body=setpoint.velocity_body,
        position=setpoint.position,
        velocity=setpoint.velocity,
        acceleration=setpoint.acceleration,
        roll=setpoint.roll,
        pitch=setpoint.pitch,
        yaw=setpoint.yaw,
        rates=setpoint.rates,
        quaternion=setpoint.quaternion,
        thrust=setpoint.thrust,
        age=1e-3 * age_ms,
    )
