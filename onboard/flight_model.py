"""A small model of the vehicle, for a drone that rehearses by itself: reference of ``core/flight_model.c``.

It flies on the drone in the place of estimator and gyro. A rigid body whose four thrusts follow with a
first-order lag; it knows no air, no ceiling, no floor and no noise, and takes the battery's compensation for
perfect. One step is drift, kick, drift: half a step with the velocities that it has, their change by the
forces in the middle, the other half. Second order; motors exact.
"""

import math
from typing import NamedTuple

import numpy as np

from onboard.arrays import FloatArray, Vector
from onboard.gravity import GRAVITY
from onboard.jit import inner, outlined
from onboard.mixer import Thrusts
from onboard.rotation import body_z, integrate
from onboard.vehicle import Vehicle

SIZE = 17
"""Numbers of a state: position (m), velocity (m/s), attitude (x, y, z, w), body rate (rad/s), thrusts (N)."""

RATE, THRUST = 10, 13
"""Where body rate and thrusts begin; what is before lies as in an estimator's state."""


class FlightModel(NamedTuple):
    """What the model takes from a vehicle's constants, SI."""

    mass: float
    inertia_xx: float
    inertia_yy: float
    inertia_zz: float
    arm_x: float
    arm_y: float
    thrust_max: float
    thrust_min: float
    time_constant_up: float
    time_constant_down: float
    thrust_to_torque: float


def flight_model(vehicle: Vehicle) -> FlightModel:
    """The model of a vehicle; its effects, legs, battery and air are not in it."""
    body, motors = vehicle.body, vehicle.motors
    return FlightModel(
        mass=body.mass.value,
        inertia_xx=body.inertia_xx.value,
        inertia_yy=body.inertia_yy.value,
        inertia_zz=body.inertia_zz.value,
        arm_x=body.arm_x.value,
        arm_y=body.arm_y.value,
        thrust_max=motors.thrust_max.value,
        thrust_min=motors.thrust_min.value,
        time_constant_up=motors.time_constant_up.value,
        time_constant_down=motors.time_constant_down.value,
        thrust_to_torque=motors.thrust_to_torque.value,
    )


def hovering(position: Vector, model: FlightModel) -> FloatArray:
    """State (17,) of a model that hovers at `position` (m): level, still, with thrusts that carry it."""
    state = np.zeros(SIZE)
    state[:3] = position
    state[9] = 1.0
    state[THRUST:] = 0.25 * model.mass * GRAVITY
    return state


@inner
def _drift(state: FloatArray, dt: float) -> None:
    for i in range(3):
        state[i] += dt * state[3 + i]
    state[6], state[7], state[8], state[9] = integrate(
        (state[6], state[7], state[8], state[9]), (state[10], state[11], state[12]), dt
    )


@inner
def _follow(state: FloatArray, thrusts: Thrusts, model: FlightModel, up: float, down: float) -> None:
    """`up` and `down`: what is left of an error of a rising and of a falling thrust."""
    for i in range(4):
        # Below its least thrust a motor stands still.
        wanted = min(thrusts[i], model.thrust_max) if thrusts[i] > model.thrust_min else 0.0
        error = state[THRUST + i] - wanted
        state[THRUST + i] = wanted + error * (up if error < 0.0 else down)


@inner
def _angular_acceleration(w: Vector, torque: Vector, model: FlightModel) -> Vector:
    """Euler's equation."""
    jx, jy, jz = model.inertia_xx, model.inertia_yy, model.inertia_zz
    return (
        (torque[0] + (jy - jz) * w[1] * w[2]) / jx,
        (torque[1] + (jz - jx) * w[2] * w[0]) / jy,
        (torque[2] + (jx - jy) * w[0] * w[1]) / jz,
    )


@inner
def _kick(state: FloatArray, model: FlightModel, dt: float) -> None:
    """The velocities after `dt` s of the present thrusts; the rate by the midpoint rule."""
    f1, f2, f3, f4 = state[13], state[14], state[15], state[16]
    b3 = body_z((state[6], state[7], state[8], state[9]))
    gained = dt * (f1 + f2 + f3 + f4) / model.mass
    state[3] += gained * b3[0]
    state[4] += gained * b3[1]
    state[5] += gained * b3[2] - dt * GRAVITY
    torque = (
        model.arm_y * (f3 + f4 - f1 - f2),
        model.arm_x * (f2 + f3 - f1 - f4),
        model.thrust_to_torque * (f2 + f4 - f1 - f3),
    )
    w = (state[10], state[11], state[12])
    a = _angular_acceleration(w, torque, model)
    half = 0.5 * dt
    a = _angular_acceleration((w[0] + half * a[0], w[1] + half * a[1], w[2] + half * a[2]), torque, model)
    for i in range(3):
        state[RATE + i] += dt * a[i]


@outlined
def fly_model(state: FloatArray, thrusts: Thrusts, model: FlightModel, dt: float) -> None:
    """`dt` s in which the motors are asked for `thrusts` (N), in place; what is no number gives no thrust.

    Args:
        state: (17,).
        thrusts: M1 to M4.
        model: of the vehicle.
        dt: s, 0.001 on the drone.
    """
    half = 0.5 * dt
    up, down = math.exp(-half / model.time_constant_up), math.exp(-half / model.time_constant_down)
    _drift(state, half)
    _follow(state, thrusts, model, up, down)
    _kick(state, model, dt)
    _follow(state, thrusts, model, up, down)
    _drift(state, half)
