"""Fly a course in the simulation, with the disturbances of a real flight, and record it.

The firmware's controller, mixer and battery compensation fly the vehicle that a hypothesis describes; they
themselves know the vehicle file only. Away from floor and ceiling there is nothing to touch, so that
a step is one of free flight.
"""

import math
from pathlib import Path
from typing import Any

import numpy as np

from calibration.gap.data.record import FlightRecord
from calibration.gap.replay.closed_loop import control
from calibration.gap.replay.kernels import interpolated, keep
from onboard.arrays import FloatArray
from onboard.controller import ControllerGains, controller_gains, integrate_position_error
from onboard.manoeuvres.course import RATE, Course
from onboard.room import RoomGeometry
from onboard.rotation import from_yaw
from onboard.thrust_map import ThrustMap
from onboard.vehicle import Vehicle
from sim_backend.physics.battery import draw, motor_targets
from sim_backend.physics.jit import outlined
from sim_backend.physics.motors import commanded, decay
from sim_backend.physics.parameters import physics_parameters
from sim_backend.physics.reset import charged, with_cold_motors
from sim_backend.physics.state import new_state
from sim_backend.physics.step import free_substep

TORQUE_DISTURBANCE = (2.2, 0.06)
"""rad/s2 and s: standard deviation and correlation time on measured flights of a Crazyflie 2.1."""

FORCE_DISTURBANCE = (0.06, 0.4)
"""m/s2 and s, likewise."""

ASTRAY = 0.6
"""m from the reference: more than the feed-forward of a healthy vehicle ever misses."""

_STEP = 1e-3
_CONTROL_STEPS, _POSITION_STEPS = 2, 10
_SETPOINT = 11  # position, velocity, acceleration, yaw, yaw rate
_LOGGED = 21  # position, velocity, quaternion, rate, duty, specific force, voltage


@outlined
def _fly(
    state: Any, p: Any, gains: ControllerGains, thrust_map: ThrustMap, course: Any, disturbance: Any, out: Any
) -> None:
    """Fly `course` (n, 11) and log every sample into `out` (n, 21).

    Args:
        disturbance: rad/s2 and m/s2 (world) of each sample interval, shape (n, 6).
    """
    up, down = decay(p, 0.5 * _STEP)
    per_sample = 10
    integral = lagged = (0.0, 0.0, 0.0)
    duty, target = np.zeros(4), np.zeros(_SETPOINT)
    count = 0
    for row in range(course.shape[0]):
        here = min(row, course.shape[0] - 2)
        for j in range(per_sample):
            # The firmware's planner moves the setpoint at each of its steps. One that stands between two rows
            # and then jumps is a jolt for the lead of the moments, at the very instant that is logged.
            for i in range(_SETPOINT):
                target[i] = interpolated(course, here, row - here + j / per_sample, i)
            if count % _POSITION_STEPS == 0:
                integral = integrate_position_error(
                    integral, state.position, target[0:3], _POSITION_STEPS * _STEP, gains.integral_limit
                )
            if count % _CONTROL_STEPS == 0:
                rate = (state.omega[0], state.omega[1], state.omega[2] - target[10])
                lagged = control(
                    state, p, gains, thrust_map, integral, rate, target, lagged, _CONTROL_STEPS * _STEP, duty
                )
            targets = commanded(state, p, motor_targets(state, p, duty))
            if j == 0:
                _log(state, duty, out[row])
            free_substep(state, p, targets, _STEP, up, down)
            draw(state, p, _STEP)
            if j == 0:
                for i in range(3):
                    out[row, 17 + i] = state.specific_force[i]
            for i in range(3):
                state.omega[i] += disturbance[row, i] * _STEP
                state.velocity[i] += disturbance[row, 3 + i] * _STEP
            count += 1


@outlined
def _log(state: Any, duty: Any, out: Any) -> None:
    keep(state, out)
    for i in range(4):
        out[13 + i] = duty[i]
    out[20] = state.battery_voltage


def fly_course(
    vehicle: Vehicle, course: Course, room: RoomGeometry, rng: np.random.Generator, shape: str
) -> FlightRecord | None:
    """The record of a flight of `vehicle` (with its effects) along a course, without errors of measurement.

    None when the vehicle strays from the course further than :data:`ASTRAY`, or touches ceiling or floor:
    nobody should fly it.

    Args:
        vehicle: what flies; the controller knows it without its effects.
        course: what it is asked to do.
        room: where.
        rng: for the disturbances.
        shape: name of the trajectory's shape.
    """
    p = physics_parameters(vehicle, room)
    count = course.t.size
    state = with_cold_motors(charged(new_state(), p))
    state["position"] = course.start
    state["quaternion"] = from_yaw(float(course.yaw[0]))
    state["thrust"] = p["mass"] * p["gravity"] / 4.0
    setpoints = np.column_stack(
        (course.position, course.velocity, course.acceleration, np.unwrap(course.yaw), course.yaw_rate)
    )
    disturbance = np.column_stack(
        (_coloured(rng, count, *TORQUE_DISTURBANCE), _coloured(rng, count, *FORCE_DISTURBANCE))
    )
    out = np.empty((count, _LOGGED))
    _fly(
        state, p, controller_gains(vehicle), vehicle.motors.thrust_map_compiled(), setpoints, disturbance, out
    )
    if not _followed(out, course, p):
        return None
    known = np.ones(count, dtype=np.bool_)
    return FlightRecord(
        name=shape,
        source=Path(shape),
        shape=shape,
        t=course.t,
        position=out[:, 0:3],
        velocity=out[:, 3:6],
        attitude=out[:, 6:10],
        rate=out[:, 10:13],
        specific_force=out[:, 17:20],
        duty=out[:, 13:17],
        voltage=out[:, 20],
        flying=known,
        motors_known=known,
        pose_known=known,
        inertial_known=known,
        resting=~known,
        ceiling_z=room.ceiling_z,
    )


def _followed(out: FloatArray, course: Course, p: Any) -> bool:
    height = out[:, 2]
    top = float(max(p["body_top_z"], p["propeller_height_z"]))
    clear = height.max() + top < p["ceiling_z"] and height.min() > -float(p["body_bottom_z"])
    return bool(clear and np.all(np.linalg.norm(out[:, :3] - course.position, axis=1) < ASTRAY))


def _coloured(rng: np.random.Generator, count: int, deviation: float, seconds: float) -> FloatArray:
    """Three Ornstein-Uhlenbeck processes at the rate of a course, shape (count, 3)."""
    keep = math.exp(-1.0 / (RATE * seconds))
    noise = deviation * math.sqrt(1.0 - keep * keep) * rng.standard_normal((count, 3))
    values = np.empty((count, 3))
    values[0] = deviation * rng.standard_normal(3)
    for k in range(1, count):
        values[k] = keep * values[k - 1] + noise[k]
    return values
