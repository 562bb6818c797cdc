"""Closed-loop re-simulation: what the model needs to fly the measured path.

The project's own controller flies the model along the measured positions. A right model needs the thrust and
the attitude that the real vehicle needed; what an open-loop replay gets wrong by feedback is right here.
The controller is trimmed for the model and stops at full duty, as those that flew: they integrate the error
of the attitude, ours does not, and motors that differ, or a centre of mass beside the middle, push it off.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.signal import savgol_filter

from calibration.gap.data.record import FlightRecord
from calibration.gap.replay.hover import hover_command, mixed, up_to_full_duty
from calibration.gap.replay.inputs import PredictionInputs, motor_starts, prediction_inputs
from calibration.gap.replay.kernels import interpolated, keep
from calibration.gap.replay.nuisances import Nuisances
from calibration.gap.replay.windows import longest_stretch
from onboard.arrays import BoolArray, FloatArray, Vector
from onboard.battery import thrust_from_voltage
from onboard.controller import (
    ControllerGains,
    controller_gains,
    geometric_control,
    integrate_position_error,
    lead_moments,
)
from onboard.thrust_map import ThrustMap
from onboard.vehicle import Vehicle
from sim_backend.physics.battery import draw, motor_targets
from sim_backend.physics.jit import kernel, outlined
from sim_backend.physics.motors import commanded, decay
from sim_backend.physics.step import free_substep

SETTLING = 1.0
"""s at the beginning that the controller has to get onto the path."""
SHORTEST = 3.0
"""s of known flight that are needed."""

CONTROL_PERIOD = 2e-3
"""s from one run of the controller to the next."""
UNTRIMMED: Vector = (0.0, 0.0, 0.0)
"""N m: moments of a controller that knows of no torque to be held against."""
_ACCELERATION_WINDOW = 0.15
SETPOINT = 11
"""Numbers of a setpoint: position, velocity, acceleration, yaw, yaw rate; m, rad, s, world."""
LOGGED = 21
"""Numbers of a row: position, velocity, quaternion, rate, duty, specific force, voltage; SI."""


@dataclass(frozen=True, kw_only=True)
class ClosedLoopFlight:
    """A measured flight and the model that flew it again.

    Attributes:
        t: s, shape (n,), without the settling.
        duty, needed_duty: mean of the four motors, measured and needed by the model, shape (n,).
        attitude, needed_attitude: quaternions, shape (n, 4).
        known: where the measured commands are known, shape (n,).
    """

    name: str
    t: FloatArray
    duty: FloatArray
    needed_duty: FloatArray
    attitude: FloatArray
    needed_attitude: FloatArray
    known: BoolArray


@kernel
def _control(
    state: Any, p: Any, gains: ControllerGains, thrust_map: ThrustMap, integral: Any,
    setpoint: Any, lagged: Vector, trim: Vector, dt: float, duty: Any,
) -> Vector:  # fmt: skip
    """Duties of the firmware's controller, mixer and battery compensation, into `duty` (4,).

    `lagged` is the memory of :func:`onboard.controller.lead_moments`, returned as it is after `dt` (s).
    """
    rate = (state.omega[0], state.omega[1], state.omega[2] - setpoint[10])
    wanted = geometric_control(
        state.position, state.velocity, state.quaternion, rate, integral,
        setpoint[0:3], setpoint[3:6], setpoint[6:9], setpoint[9], gains,
    )  # fmt: skip
    wrench, lagged = lead_moments(wanted, lagged, gains, dt)
    moments = wrench[1] + trim[0], wrench[2] + trim[1], wrench[3] + trim[2]
    mixed(state, p, thrust_map, wrench[0], moments, duty)
    return lagged


@outlined
def fly_setpoints(
    state: Any, p: Any, gains: ControllerGains, thrust_map: ThrustMap, setpoints: Any, voltage: Any,
    disturbance: Any, trim: Vector, substeps: int, h: float, control_steps: int, position_steps: int,
    out: Any,
) -> None:  # fmt: skip
    """Fly a model, away from floor and ceiling, as the firmware would along these setpoints.

    Args:
        state: where it begins; changed.
        p: parameters.
        gains, thrust_map: of the controller and its battery compensation.
        setpoints: at the samples, shape (n, 11), see :data:`SETPOINT`.
        voltage: V, shape (n,), that the motors get; shape (0,): that of the model's own battery.
        disturbance: rad/s2 (body) and m/s2 (world) of each sample interval, shape (n, 6).
        trim: N m, moments that the controller adds to its own.
        substeps, h: steps from one sample to the next, and their length (s).
        control_steps, position_steps: steps between two runs of the controller, and of its integrator.
        out: filled at every sample, shape (n, 21), see :data:`LOGGED`.
    """
    up, down = decay(p, 0.5 * h)
    integral = lagged = (0.0, 0.0, 0.0)
    duty, target = np.zeros(4), np.zeros(SETPOINT)
    count = 0
    for row in range(setpoints.shape[0]):
        here = min(row, setpoints.shape[0] - 2)
        for j in range(substeps):
            share = row - here + j / substeps
            # The firmware's planner moves the setpoint at each of its steps. One that stands between two rows
            # and then jumps is a jolt for the lead of the moments, at the very instant that is logged.
            for i in range(SETPOINT):
                target[i] = interpolated(setpoints, here, share, i)
            if voltage.size > 0:
                state.battery_voltage = voltage[here] + share * (voltage[here + 1] - voltage[here])
            if count % position_steps == 0:
                integral = integrate_position_error(
                    integral, state.position, target[0:3], position_steps * h, gains.integral_limit
                )
            if count % control_steps == 0:
                lagged = _control(
                    state, p, gains, thrust_map, integral, target, lagged, trim, control_steps * h, duty
                )
            targets = commanded(state, p, motor_targets(state, p, duty))
            if j == 0:
                keep(state, out[row])
                for i in range(4):
                    out[row, 13 + i] = duty[i]
                out[row, 20] = state.battery_voltage
            free_substep(state, p, targets, h, up, down)
            if voltage.size == 0:
                draw(state, p, h)
            if j == 0:
                for i in range(3):
                    out[row, 17 + i] = state.specific_force[i]
            for i in range(3):
                state.omega[i] += disturbance[row, i] * h
                state.velocity[i] += disturbance[row, 3 + i] * h
            count += 1


def fly_again(
    record: FlightRecord, vehicle: Vehicle, own: Nuisances | None = None
) -> ClosedLoopFlight | None:
    """Fly the model along the longest known stretch of a measured flight.

    `own`: thrust scale and trim of this flight, as its predictions have.

    Returns:
        None when no stretch of free flight with a known pose is :data:`SHORTEST` long.

    Raises:
        SimulationError: the vehicle has an effect without an equation.
    """
    inputs = prediction_inputs(record, vehicle)
    stretch = longest_stretch(record.flying & record.pose_known)
    if (stretch.stop - stretch.start) * record.dt < SHORTEST:
        return None
    own = own or Nuisances()
    p = own.scaled(inputs.parameters)
    starts, _ = motor_starts(inputs, p, np.array([stretch.start]))
    starts["velocity"] = inputs.velocity[stretch.start]
    starts["omega"] = 0.0  # the gyro may not be known there, and the controller settles
    count = stretch.stop - stretch.start
    control_steps = max(1, round(CONTROL_PERIOD / inputs.step))
    out = np.empty((count, LOGGED))
    thrust_map, voltage = vehicle.motors.thrust_map_compiled(), inputs.voltage[stretch]
    highest = float(voltage.max())
    gains = up_to_full_duty(controller_gains(vehicle), thrust_from_voltage(thrust_map, highest))
    turned = np.asarray(own.angular_acceleration_rad_s2)
    pushed = tuple((p["inertia"] * turned).tolist())
    # A trim is a moment: no battery changes it, but one that is low may hold no hover to find it in.
    held = hover_command(p, thrust_map, highest, inputs.position[stretch.start], pushed)
    disturbance = np.zeros((count, 6))
    disturbance[:, :3] = turned
    fly_setpoints(
        starts[0], p, gains, thrust_map,
        _path(inputs, stretch), voltage, disturbance, held.moments if held else UNTRIMMED,
        inputs.substeps, inputs.step, control_steps, control_steps, out,
    )  # fmt: skip
    settled = slice(inputs.rows(SETTLING), None)
    return ClosedLoopFlight(
        name=record.name,
        t=record.t[stretch][settled],
        duty=inputs.duty[stretch][settled].mean(axis=1),
        needed_duty=out[settled, 13:17].mean(axis=1),
        attitude=inputs.quaternion[stretch][settled],
        needed_attitude=out[settled, 6:10],
        known=record.motors_known[stretch][settled],
    )


def _path(inputs: PredictionInputs, stretch: slice) -> FloatArray:
    """Setpoints at the samples, shape (n, 11): as measured, without a yaw rate."""
    position = inputs.position[stretch]
    width = 2 * (inputs.rows(_ACCELERATION_WINDOW) // 2) + 1
    acceleration = savgol_filter(position, max(width, 5), 3, deriv=2, delta=inputs.dt, axis=0)
    forward = inputs.rotation[stretch, :, 0]
    yaw = np.unwrap(np.arctan2(forward[:, 1], forward[:, 0]))
    still = np.zeros(yaw.size)
    return np.column_stack([position, inputs.velocity[stretch], acceleration, yaw, still])
