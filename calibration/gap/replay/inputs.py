"""A flight as the prediction needs it: the vehicle's own state, and inputs to its motors.

A vehicle file may say that the tracked frame lags, leans or lies beside the body, and that the gyro has a
bias (pose_delay, pose_rotation, pose_offset, gyro_bias, com_offset). Those are taken out of the measurements
first, so that the model is held against what the vehicle did.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from calibration.gap.data.kinematics import continuous_quaternions
from calibration.gap.data.record import FlightRecord
from calibration.gap.replay.kernels import follow_duty
from onboard.arrays import BoolArray, FloatArray
from onboard.room import RoomGeometry
from onboard.rotation import to_matrices
from onboard.vehicle import Vehicle
from sim_backend.physics.effects.command import set_step
from sim_backend.physics.effects.command_delay import STEP
from sim_backend.physics.parameters import physics_parameters
from sim_backend.physics.reset import with_cold_motors
from sim_backend.physics.state import new_state, new_states

VELOCITY_WINDOW = 0.1
"""s before a start whose positions give its velocity."""

NO_CEILING = 1e3
"""m: a ceiling that no rotor feels, and nothing reaches."""


def below_no_ceiling(vehicle: Vehicle) -> Any:
    """Physics parameters far from any ceiling."""
    return physics_parameters(vehicle, RoomGeometry(ceiling_z=NO_CEILING))


@dataclass(frozen=True)
class PredictionInputs:
    """One flight, seen through one vehicle file.

    Attributes:
        record: the flight as it was measured.
        position, velocity: m, m/s, world, shape (n, 3), of the centre of mass; the velocity is the record's.
        quaternion: shape (n, 4), body to world.
        rotation: the same as matrices, shape (n, 3, 3).
        rate: rad/s, body, shape (n, 3).
        start_velocity: m/s, shape (n, 3), from the past alone; NaN where there is not enough of it.
        board, board_swing: m, m/s, world, shape (n, 3), of the accelerometer from the centre of mass.
        duty: shape (n, 4). voltage: V, shape (n,).
        known: shape (n,): pose, gyro and motor commands are all known.
        parameters: of the physics; a delay of the commands, and their warming, count in steps of `step`.
        substeps, step: steps from one sample to the next, about 1 ms, and their length (s).
    """

    record: FlightRecord
    position: FloatArray
    velocity: FloatArray
    quaternion: FloatArray
    rotation: FloatArray
    rate: FloatArray
    start_velocity: FloatArray
    board: FloatArray
    board_swing: FloatArray
    duty: FloatArray
    voltage: FloatArray
    known: BoolArray
    parameters: Any
    substeps: int
    step: float

    @property
    def dt(self) -> float:
        """Sample interval (s)."""
        return self.record.dt

    def rows(self, seconds: float) -> int:
        """Samples in a time (s), rounded."""
        return round(seconds / self.dt)


def prediction_inputs(record: FlightRecord, vehicle: Vehicle) -> PredictionInputs:
    """The flight, seen through the vehicle file.

    Without a known ceiling there is none in the prediction.

    Raises:
        CalibrationError: the flight has no battery voltage, so that a command means no thrust.
        SimulationError: the vehicle has an effect without an equation.
    """
    ceiling = np.inf if record.ceiling_z is None else record.ceiling_z
    p = physics_parameters(vehicle, RoomGeometry(ceiling_z=ceiling))
    substeps = max(1, round(record.dt / STEP))
    step = record.dt / substeps
    set_step(p, step)
    pose, known = _pose_in_time(record, float(p["pose_delay"]))
    quaternion = _without_turn(pose[:, 6:10], p["pose_turn"])
    rotation = to_matrices(quaternion)
    lever = rotation @ (p["geometric_centre"] + p["pose_offset"])
    rate = record.rate - p["gyro_bias"]
    known = known & record.inertial_known & record.motors_known
    duty, voltage = _filled(record.duty, record.motors_known), record.known_voltage
    position = pose[:, :3] - lever
    board = rotation @ p["geometric_centre"]
    board_swing = (rotation @ np.cross(rate, p["geometric_centre"])[:, :, None])[:, :, 0]
    felt = velocity_from_the_past(position + board, _acceleration(record, rotation), record.dt)
    # The tracked point swings about the centre of mass: v = v_tracked - R (w x b).
    swing = (rotation @ np.cross(rate, p["geometric_centre"] + p["pose_offset"])[:, :, None])[:, :, 0]
    return PredictionInputs(
        record=record,
        position=position,
        velocity=pose[:, 3:6] - swing,
        quaternion=quaternion,
        rotation=rotation,
        rate=rate,
        start_velocity=felt - board_swing,
        board=board,
        board_swing=board_swing,
        duty=duty,
        voltage=_filled(voltage[:, None], np.isfinite(voltage))[:, 0],
        known=known,
        parameters=p,
        substeps=substeps,
        step=step,
    )


def motor_starts(inputs: PredictionInputs, parameters: Any, rows: Any) -> tuple[Any, FloatArray]:
    """States at the samples `rows` (increasing), motors as the commands before have left them.

    Args:
        inputs: the flight.
        parameters: of the physics, those of the inputs or a variation of them.
        rows: int64, shape (m,).

    Returns:
        States, shape (m,), with pose and velocities of the starts; thrusts (N) at all samples, shape (n, 4).
    """
    starts = new_states(rows.size)
    thrust = np.empty((inputs.duty.shape[0], 4))
    follow_duty(
        with_cold_motors(new_state()), parameters, inputs.duty, inputs.voltage, inputs.substeps, inputs.step,
        starts, rows, thrust,
    )  # fmt: skip
    starts["position"] = inputs.position[rows]
    starts["velocity"] = inputs.start_velocity[rows]
    starts["quaternion"] = inputs.quaternion[rows]
    starts["omega"] = inputs.rate[rows]
    return starts, thrust


def velocity_from_the_past(position: FloatArray, acceleration: FloatArray | None, dt: float) -> FloatArray:
    """Velocity (m/s, shape (n, 3)) at each sample from the positions up to it.

    A parabola is fitted to the last :data:`VELOCITY_WINDOW` of what the measured acceleration (m/s2, world)
    does not explain: the accelerometer carries the jerk, and its own error, a bias or a lean, is in the
    parabola. Without an accelerometer the parabola is fitted to the positions.
    """
    count = max(4, round(VELOCITY_WINDOW / dt) + 1)
    velocity = np.full_like(position, np.nan)
    if position.shape[0] < count:
        return velocity
    explained_v, explained_p = np.zeros_like(position), np.zeros_like(position)
    if acceleration is not None:
        explained_v, explained_p = twice_integrated(acceleration, dt)
    age = dt * np.arange(1 - count, 1)
    slope = np.linalg.pinv(np.vander(age, 3, increasing=True))[1]
    windows = np.lib.stride_tricks.sliding_window_view(position - explained_p, count, axis=0)
    velocity[count - 1 :] = windows @ slope + explained_v[count - 1 :]
    return velocity


def twice_integrated(acceleration: FloatArray, dt: float) -> tuple[FloatArray, FloatArray]:
    """Velocity and position, zero at the first sample, of an acceleration that is linear between samples.

    Unknown accelerations (NaN) count as zero: what spans them must not be used.
    """
    a = np.nan_to_num(acceleration)
    velocity, position = np.zeros_like(a), np.zeros_like(a)
    np.cumsum(0.5 * dt * (a[:-1] + a[1:]), axis=0, out=velocity[1:])
    np.cumsum(dt * velocity[:-1] + dt * dt / 6.0 * (2.0 * a[:-1] + a[1:]), axis=0, out=position[1:])
    return velocity, position


def _acceleration(record: FlightRecord, rotation: FloatArray) -> FloatArray | None:
    """Measured specific force in the world, without gravity, which a parabola takes in."""
    if record.specific_force is None:
        return None
    return (rotation @ record.specific_force[:, :, None])[:, :, 0]


def _pose_in_time(record: FlightRecord, delay: float) -> tuple[FloatArray, BoolArray]:
    """Position, velocity and quaternion (n, 10) that are seen `delay` (s) later, and where they are known."""
    pose = np.hstack([record.position, record.velocity, continuous_quaternions(record.attitude)])
    if delay == 0.0:
        return pose, record.pose_known
    at = record.t + delay
    moved = np.column_stack([np.interp(at, record.t, column) for column in pose.T])
    # A sample between a known and an unknown one is unknown, and so is what lies behind the last.
    known = np.interp(at, record.t, record.pose_known.astype(float), right=0.0) > 1.0 - 1e-9
    return moved, known


def _without_turn(quaternion: FloatArray, turn: FloatArray) -> FloatArray:
    """Attitude (n, 4) of the body from that of the tracked frame; `turn`: vector part of their quaternion."""
    unit = quaternion / np.linalg.norm(quaternion, axis=1, keepdims=True)  # they were interpolated
    if not np.any(turn):
        return unit
    v, w = unit[:, :3], unit[:, 3:]
    back, scalar = -turn, np.sqrt(1.0 - turn @ turn)
    return np.hstack([w * back + scalar * v + np.cross(v, back), w * scalar - (v @ back)[:, None]])


def _filled(values: FloatArray, known: BoolArray) -> FloatArray:
    """Values with straight lines across what is unknown, so that motors run on after it."""
    if known.all() or not known.any():
        return np.nan_to_num(values)
    rows = np.arange(known.size)
    return np.column_stack([np.interp(rows, rows[known], column[known]) for column in values.T])
