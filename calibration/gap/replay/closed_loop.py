"""Closed-loop re-simulation: what the model needs to fly the measured path.

The project's own controller flies the model along the measured positions. A right model needs the thrust and
the attitude that the real vehicle needed; what an open-loop replay gets wrong by feedback is right here.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.signal import savgol_filter

from calibration.gap.data.record import FlightRecord
from calibration.gap.replay.flight_prediction import rotation_between
from calibration.gap.replay.inputs import PredictionInputs, motor_starts, prediction_inputs
from calibration.gap.replay.kernels import TRIMS, Trim, free_step, interpolated
from calibration.gap.replay.nuisances import Nuisances
from calibration.gap.replay.windows import longest_stretch
from onboard.arrays import FloatArray, Vector
from onboard.battery import duty_for_thrust
from onboard.controller import (
    ControllerGains,
    controller_gains,
    geometric_control,
    integrate_position_error,
    lead_moments,
)
from onboard.mixer import mix
from onboard.thrust_map import ThrustMap
from onboard.vehicle import Vehicle
from sim_backend.physics.battery import motor_targets
from sim_backend.physics.jit import kernel, outlined
from sim_backend.physics.motors import commanded, decay

SETTLING = 1.0
"""s at the beginning that the controller has to get onto the path."""
SHORTEST = 3.0
"""s of known flight that are needed."""
LOST = 0.5
"""m from the path at which the model counts as not having flown it."""

_CONTROL_PERIOD = 2e-3
_ACCELERATION_WINDOW = 0.15
_SETPOINT = 10  # position, velocity, acceleration, yaw
_LOGGED = 15  # position, quaternion, duty, thrust


@dataclass(frozen=True, kw_only=True)
class ClosedLoopFlight:
    """A measured flight and the model that flew it again.

    Attributes:
        name: of the flight.
        t: s, shape (n,), without the settling.
        duty, needed_duty: mean of the four motors, measured and needed by the model, shape (n,).
        thrust, needed_thrust: N, all four rotors together: what the model makes of the measured commands, and
            what it needs; shape (n,).
        attitude, needed_attitude: quaternions, shape (n, 4).
        distance: m from the measured position, shape (n,).
        known: where the measured commands are known, shape (n,).
    """

    name: str
    t: FloatArray
    duty: FloatArray
    needed_duty: FloatArray
    thrust: FloatArray
    needed_thrust: FloatArray
    attitude: FloatArray
    needed_attitude: FloatArray
    distance: FloatArray
    known: Any

    @property
    def lost(self) -> bool:
        """Whether the model could not fly the path; its numbers then mean nothing."""
        return not bool(np.all(self.distance < LOST))

    def to_json(self) -> dict[str, Any]:
        """RMS differences, and the mean of the thrust needed over the thrust there was."""
        if self.lost or not self.known.any():
            return {"flight": self.name, "lost": self.lost}
        angle = np.linalg.norm(rotation_between(self.attitude, self.needed_attitude), axis=1)
        known = self.known
        return {
            "flight": self.name,
            "lost": False,
            "collective_duty_rms": _rms((self.needed_duty - self.duty)[known]),
            "collective_thrust_rms_n": _rms((self.needed_thrust - self.thrust)[known]),
            "thrust_ratio": float(np.mean(self.needed_thrust[known]) / np.mean(self.thrust[known])),
            "attitude_rms_deg": float(np.degrees(_rms(angle))),
            "position_rms_m": _rms(self.distance),
        }


def _rms(values: FloatArray) -> float:
    return float(np.sqrt(np.mean(values**2)))


@kernel
def control(
    state: Any, p: Any, gains: ControllerGains, thrust_map: ThrustMap, integral: Any, rate: Any,
    setpoint: Any, lagged: Vector, dt: float, duty: Any,
) -> Vector:  # fmt: skip
    """Duties of the firmware's controller, mixer and battery compensation, into `duty` (4,).

    `setpoint`: position, velocity, acceleration and yaw. `rate`: rad/s, body, less the one that is wanted.
    `lagged` is the memory of :func:`onboard.controller.lead_moments`, returned as it is after `dt` (s).
    """
    wanted = geometric_control(
        state.position, state.velocity, state.quaternion, rate, integral,
        setpoint[0:3], setpoint[3:6], setpoint[6:9], setpoint[9], gains,
    )  # fmt: skip
    wrench, lagged = lead_moments(wanted, lagged, gains, dt)
    thrusts = mix(
        wrench[0], wrench[1], wrench[2], wrench[3], p.arm_x, p.arm_y, p.thrust_to_torque, p.thrust_max
    )
    for motor in range(4):
        duty[motor] = duty_for_thrust(thrusts[motor], state.battery_voltage, thrust_map, 0.0)
    return lagged


@outlined
def _fly_along(
    state: Any, p: Any, gains: ControllerGains, thrust_map: ThrustMap, trim: Trim, path: Any, voltage: Any,
    substeps: int, h: float, every: int, out: Any,
) -> None:  # fmt: skip
    """Fly the model along `path` (n, 10) with a controller every `every` steps; `out`: shape (n, 15)."""
    up, down = decay(p, 0.5 * h)
    integral = lagged = (0.0, 0.0, 0.0)
    duty, setpoint = np.zeros(4), np.zeros(_SETPOINT)
    count = 0
    for row in range(path.shape[0] - 1):
        for j in range(substeps):
            share = j / substeps
            state.battery_voltage = voltage[row] + share * (voltage[row + 1] - voltage[row])
            if count % every == 0:
                for i in range(_SETPOINT):
                    setpoint[i] = interpolated(path, row, share, i)
                integral = integrate_position_error(
                    integral, state.position, setpoint[0:3], every * h, gains.integral_limit
                )
                lagged = control(
                    state, p, gains, thrust_map, integral, state.omega, setpoint, lagged, every * h, duty
                )
            if j == 0:
                _log(state, duty, out[row])
            targets = commanded(state, p, motor_targets(state, p, duty))
            free_step(state, p, targets, trim, h, up, down)
            count += 1
    _log(state, duty, out[path.shape[0] - 1])


@outlined
def _log(state: Any, duty: Any, out: Any) -> None:
    for i in range(3):
        out[i] = state.position[i]
    for i in range(4):
        out[3 + i] = state.quaternion[i]
        out[7 + i] = duty[i]
        out[11 + i] = state.thrust[i]


def fly_again(
    record: FlightRecord, vehicle: Vehicle, nuisances: Nuisances | None = None
) -> ClosedLoopFlight | None:
    """Fly the model along the longest known stretch of a measured flight.

    Args:
        record: the flight.
        vehicle: the model.
        nuisances: what the flight has beside its model.

    Returns:
        None when no stretch of free flight with a known pose is :data:`SHORTEST` long.

    Raises:
        SimulationError: the vehicle has an effect without an equation.
    """
    inputs = prediction_inputs(record, vehicle)
    stretch = longest_stretch(record.flying & record.pose_known)
    if (stretch.stop - stretch.start) * record.dt < SHORTEST:
        return None
    nuisances = nuisances or Nuisances()
    p = nuisances.scaled(inputs.parameters)
    starts, thrust = motor_starts(inputs, p, np.array([stretch.start]))
    starts["velocity"] = inputs.velocity[stretch.start]
    starts["omega"] = 0.0  # the gyro may not be known there, and the controller settles
    trim = nuisances.trim()
    out = np.empty((stretch.stop - stretch.start, _LOGGED))
    _fly_along(
        starts[0], p, controller_gains(vehicle), vehicle.motors.thrust_map_compiled(),
        tuple(trim[i] for i in range(TRIMS)), _path(inputs, stretch), inputs.voltage[stretch],
        inputs.substeps, inputs.step, max(1, round(_CONTROL_PERIOD / inputs.step)), out,
    )  # fmt: skip
    settled = slice(inputs.rows(SETTLING), None)
    return ClosedLoopFlight(
        name=record.name,
        t=record.t[stretch][settled],
        duty=inputs.duty[stretch][settled].mean(axis=1),
        needed_duty=out[settled, 7:11].mean(axis=1),
        thrust=thrust[stretch][settled].sum(axis=1),
        needed_thrust=out[settled, 11:15].sum(axis=1),
        attitude=inputs.quaternion[stretch][settled],
        needed_attitude=out[settled, 3:7],
        distance=np.linalg.norm(out[:, :3] - inputs.position[stretch], axis=1)[settled],
        known=record.motors_known[stretch][settled],
    )


def _path(inputs: PredictionInputs, stretch: slice) -> FloatArray:
    """Setpoints at the samples, shape (n, 10): position, velocity, acceleration and yaw as measured."""
    position = inputs.position[stretch]
    width = 2 * (inputs.rows(_ACCELERATION_WINDOW) // 2) + 1
    acceleration = savgol_filter(position, max(width, 5), 3, deriv=2, delta=inputs.dt, axis=0)
    forward = inputs.rotation[stretch, :, 0]
    yaw = np.unwrap(np.arctan2(forward[:, 1], forward[:, 0]))
    return np.hstack([position, inputs.velocity[stretch], acceleration, yaw[:, None]])
