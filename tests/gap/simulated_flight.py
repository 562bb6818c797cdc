"""Flights of the simulation as records: a controller follows a path, everything is logged at 100 Hz.

Commands and voltage go in straight lines from sample to sample, as the prediction takes them (commands a
little later), so that a model predicts its own flights without error where nothing is noisy.
"""

import dataclasses
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from calibration.gap.data.record import FlightRecord
from calibration.gap.replay.kernels import HELD
from onboard.arrays import FloatArray
from onboard.battery import duty_for_thrust
from onboard.controller import ControllerGains, controller_gains, geometric_control
from onboard.jit import outlined
from onboard.mixer import mix
from onboard.room import RoomGeometry
from onboard.rotation import from_rotation_vector, multiply
from onboard.thrust_map import ThrustMap
from onboard.vehicle import Vehicle
from sim_backend.physics.effects.command import set_step
from sim_backend.physics.effects.sensors import measured_rate, tracked_attitude, tracked_position
from sim_backend.physics.parameters import physics_parameters
from sim_backend.physics.reset import approaching, with_cold_motors
from sim_backend.physics.step import step

DT = 0.01
SUBSTEPS = 10

Path3 = Callable[[FloatArray], FloatArray]
"""Position (m, shape (n, 3)) at times (s, shape (n,))."""


@outlined
def _fly(
    state: Any, p: Any, gains: ControllerGains, thrust_map: ThrustMap, path: Any, voltage: Any, out: Any,
    step_s: float, fine: int,
) -> None:  # fmt: skip
    """Follow `path` (n, 9); log position, velocity, quaternion, rate, specific force, duty (20 numbers)."""
    before, now, following, between = np.zeros(4), np.zeros(4), np.zeros(4), np.zeros(4)
    hover = 0.25 * p.mass * 9.81
    for motor in range(4):
        before[motor] = now[motor] = following[motor] = duty_for_thrust(hover, voltage[0], thrust_map, 0.0)
    integral = (0.0, 0.0, 0.0)
    for row in range(path.shape[0] - 1):
        collective, tx, ty, tz = geometric_control(
            state.position, state.velocity, state.quaternion, state.omega, integral,
            path[row, 0:3], path[row, 3:6], path[row, 6:9], 0.0, gains,
        )  # fmt: skip
        wanted = mix(collective, tx, ty, tz, p.arm_x, p.arm_y, p.thrust_to_torque, p.thrust_max)
        for motor in range(4):
            before[motor] = now[motor]
            now[motor] = following[motor]
            following[motor] = duty_for_thrust(wanted[motor], voltage[row + 1], thrust_map, 0.0)
        at, turn, rate = tracked_position(state, p), tracked_attitude(state, p), measured_rate(state, p)
        for i in range(3):
            out[row, i], out[row, 3 + i], out[row, 10 + i] = at[i], state.velocity[i], rate[i]
            out[row, 13 + i] = state.specific_force[i]
        for i in range(4):
            out[row, 6 + i], out[row, 16 + i] = turn[i], now[i]
        for j in range(fine):
            share = (j + 0.5) / fine
            for motor in range(4):
                late = share - HELD / DT
                old, new = (now[motor], following[motor]) if late >= 0.0 else (before[motor], now[motor])
                between[motor] = old + (late if late >= 0.0 else late + 1.0) * (new - old)
            state.battery_voltage = voltage[row] + share * (voltage[row + 1] - voltage[row])
            step(state, p, between, step_s)


def circle(radius: float = 0.6, period: float = 4.0, height: float = 1.0) -> Path3:
    """Laps in the plane, from rest at the centre."""

    def at(t: FloatArray) -> FloatArray:
        grown = radius * np.minimum(1.0, t / 3.0) ** 2
        turn = 2.0 * np.pi * t / period
        return np.column_stack([grown * np.cos(turn), grown * np.sin(turn), np.full(t.size, height)])

    return at


def up_and_down(amplitude: float = 0.4, period: float = 2.5, height: float = 1.0) -> Path3:
    """Vertical flight with a little sway."""

    def at(t: FloatArray) -> FloatArray:
        turn = 2.0 * np.pi * t / period
        grown = np.minimum(1.0, t / 2.0)
        return np.column_stack(
            [0.1 * grown * np.sin(0.7 * turn), np.zeros(t.size), height + amplitude * grown * np.sin(turn)]
        )

    return at


def hover(height: float = 1.0) -> Path3:
    """On the spot."""
    return lambda t: np.tile([0.0, 0.0, height], (t.size, 1))


def fly(
    vehicle: Vehicle,
    path: Path3,
    seconds: float = 12.0,
    *,
    shape: str = "circle",
    name: str = "simulated",
    ceiling_z: float | None = None,
    believed: Vehicle | None = None,
    fine: int = SUBSTEPS,
    sag: float = 0.25,
) -> FlightRecord:
    """One flight without noise.

    Args:
        vehicle: the truth.
        path: what its controller follows.
        seconds: length.
        shape, name: of the record.
        ceiling_z: m.
        believed: what controller and battery compensation think the vehicle is; default: without effects.
        fine: steps of the physics from one sample to the next.
        sag: V that the battery falls by over the flight.
    """
    believed = believed or dataclasses.replace(vehicle, effects=())
    room = RoomGeometry(ceiling_z=1e6 if ceiling_z is None else ceiling_z)
    p = physics_parameters(vehicle, room)
    set_step(p, DT / fine)
    t = DT * np.arange(round(seconds / DT) + 1)
    position = path(t)
    velocity = np.gradient(position, DT, axis=0)
    setpoints = np.hstack([position, velocity, np.gradient(velocity, DT, axis=0)])
    voltage = 3.9 - sag * t / t[-1]
    state = with_cold_motors(approaching(p, position[0], np.zeros(3)))
    # What the accelerometer shows in a hover: the first sample comes before any step.
    state["specific_force"] = [0.0, 0.0, float(p["gravity"])]
    out = np.empty((t.size, 20))
    # The commands of a log at 100 Hz are up to two samples late: softer than on board.
    stiff = controller_gains(believed)
    gains = stiff._replace(
        kp_xy=0.5 * stiff.kp_xy, kd_xy=0.5 * stiff.kd_xy, kr_xy=0.655 * stiff.kr_xy, kw_xy=1.05 * stiff.kw_xy,
        kr_z=0.3 * stiff.kr_z, kw_z=0.5 * stiff.kw_z,
    )  # fmt: skip
    _fly(state, p, gains, believed.motors.thrust_map_compiled(), setpoints, voltage, out, DT / fine, fine)
    return _record(out[:-1], t[:-1], voltage[:-1], name, shape, ceiling_z)


def _record(
    out: FloatArray, t: FloatArray, voltage: FloatArray, name: str, shape: str, ceiling_z: float | None
) -> FlightRecord:
    everywhere = np.ones(t.size, dtype=np.bool_)
    return FlightRecord(
        name=name,
        source=Path(name),
        shape=shape,
        t=t,
        position=out[:, 0:3],
        velocity=out[:, 3:6],
        attitude=out[:, 6:10],
        rate=out[:, 10:13],
        specific_force=out[:, 13:16],
        duty=out[:, 16:20],
        voltage=voltage,
        flying=everywhere & (t > 0.5),
        motors_known=everywhere,
        pose_known=everywhere,
        inertial_known=everywhere,
        resting=~everywhere,
        ceiling_z=ceiling_z,
    )


def with_noise(record: FlightRecord, scale: float, rng: np.random.Generator) -> FlightRecord:
    """The record with `scale` times ordinary sensor noise (gap note, 5)."""

    def noise(size: float, width: int) -> FloatArray:
        return scale * size * rng.standard_normal((record.t.size, width))

    turns = noise(np.radians(0.17), 3)
    attitude = np.array(
        [multiply(q, from_rotation_vector(turn)) for q, turn in zip(record.attitude, turns, strict=True)]
    )
    force = record.specific_force
    return dataclasses.replace(
        record,
        position=record.position + noise(2e-4, 3),
        velocity=record.velocity + noise(5e-3, 3),
        attitude=attitude,
        rate=record.rate + noise(0.01, 3),
        specific_force=None if force is None else force + noise(0.05, 3),
    )


def write_table(record: FlightRecord, path: Path, rng: np.random.Generator) -> Path:
    """The record as a file of the format ``table``, with commands that jitter as real ones do."""
    assert record.specific_force is not None
    assert record.voltage is not None
    jitter = rng.integers(-6, 7, size=record.duty.shape)
    columns = {
        "t": record.t,
        "x,y,z": record.position,
        "qx,qy,qz,qw": record.attitude,
        "gx,gy,gz": record.rate,
        "ax,ay,az": record.specific_force,
        "m1,m2,m3,m4": np.clip(np.round(65535.0 * record.duty) + jitter, 0, 65535),
        "vbat": record.voltage,
    }
    table = np.column_stack(list(columns.values()))
    np.savetxt(path, table, delimiter=",", header=",".join(columns), comments="", fmt="%.9g")
    return path
