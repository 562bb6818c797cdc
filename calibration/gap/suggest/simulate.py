"""Fly a course in the simulation, with the disturbances of a real flight, and record it.

The firmware's controller, mixer and battery compensation fly the vehicle that a hypothesis describes; they
themselves know the vehicle file only. Away from floor and ceiling there is nothing to touch, so that
a step is one of free flight.
"""

import math
from pathlib import Path
from typing import Any

import numpy as np
from scipy.signal import lfilter

from calibration.gap.data.record import FlightRecord
from calibration.gap.replay.closed_loop import CONTROL_PERIOD, LOGGED, UNTRIMMED, fly_setpoints
from onboard.arrays import FloatArray
from onboard.controller import controller_gains
from onboard.manoeuvres.course import RATE, Course
from onboard.room import RoomGeometry
from onboard.rotation import from_yaw
from onboard.vehicle import Vehicle
from sim_backend.physics.parameters import physics_parameters
from sim_backend.physics.reset import charged, with_cold_motors
from sim_backend.physics.state import new_state

TORQUE_DISTURBANCE = (2.2, 0.06)
"""rad/s2 and s: standard deviation and correlation time on measured flights of a Crazyflie 2.1."""

FORCE_DISTURBANCE = (0.06, 0.4)
"""m/s2 and s, likewise."""

ASTRAY = 0.6
"""m from the reference: more than the feed-forward of a healthy vehicle ever misses."""

_STEP, _PER_SAMPLE = 1e-3, 10
_CONTROL_STEPS, _POSITION_STEPS = round(CONTROL_PERIOD / _STEP), 10


def fly_course(
    vehicle: Vehicle, course: Course, room: RoomGeometry, rng: np.random.Generator, shape: str
) -> FlightRecord | None:
    """The record of a flight of `vehicle` (with its effects) along a course, without errors of measurement.

    None when the vehicle strays from the course further than :data:`ASTRAY`, or touches ceiling or floor:
    nobody should fly it.

    `shape` is the name of its trajectory's shape; `rng` draws the disturbances.
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
    out = np.empty((count, LOGGED))
    fly_setpoints(
        state, p, controller_gains(vehicle), vehicle.motors.thrust_map_compiled(), setpoints, np.empty(0),
        disturbance, UNTRIMMED, _PER_SAMPLE, _STEP, _CONTROL_STEPS, _POSITION_STEPS, out,
    )  # fmt: skip
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
    noise[0] = deviation * rng.standard_normal(3)
    return np.asarray(lfilter([1.0], [1.0, -keep], noise, axis=0))
