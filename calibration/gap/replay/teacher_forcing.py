"""Teacher forcing: what the simulation's physics says about each moment of a measured flight.

The vehicle is put where it was measured to be, sample by sample, and its motors follow the logged commands
through the physics' own lag and effects. Out come the specific force at each sample and the mean angular
acceleration over each sample interval. What happens to attitude and position afterwards is not the model's
business here, so that errors do not add up and each channel is judged by itself.
"""

import math
from typing import Any, NamedTuple

import numpy as np

from calibration.gap.data.record import FlightRecord
from calibration.gap.replay.kernels import duty_between, settle
from onboard.arrays import FloatArray, Vector
from onboard.battery import battery_current
from sim_backend.physics.battery import motor_targets
from sim_backend.physics.effects.command import set_step
from sim_backend.physics.frames import Wrench
from sim_backend.physics.jit import inner, outlined
from sim_backend.physics.motors import commanded, decay, lag_to_end, lag_to_middle
from sim_backend.physics.reset import with_cold_motors
from sim_backend.physics.rigid_body import acceleration_beside, gyroscopic_torque, unit
from sim_backend.physics.state import new_state
from sim_backend.physics.step import in_free_flight

LONGEST_STEP = 2e-3
"""s, between two samples. Commands are straight there, so that twice the simulation's step moves predictions
by less than a hundredth of the noise of a log of 100 Hz, and a search takes two thirds of the time."""


class Prediction(NamedTuple):
    """What a model says along a measured flight of n samples.

    Attributes:
        force: m/s2, body, shape (n, 3): specific force at each sample, in the middle of the drone.
        angular_acceleration: rad/s2, body, shape (n - 1, 3): mean over each sample interval.
        turn_up: rad/s2, body, shape (n, 3): angular acceleration at each sample, as in `force`.
        thrust: N, shape (n, 4), of the motors at each sample.
        current: A, shape (n,), out of the battery.
        charge: C, shape (n,), drawn since the first sample.
    """

    force: FloatArray
    angular_acceleration: FloatArray
    turn_up: FloatArray
    thrust: FloatArray
    current: FloatArray
    charge: FloatArray


@outlined
def _place(state: Any, record: Any, k: int, part: float) -> None:
    """Put the vehicle where it was measured, `part` (0..1) of the way from sample `k` to the next."""
    position, velocity, attitude, rate, _, voltage = record
    rest = 1.0 - part
    for i in range(3):
        state.position[i] = rest * position[k, i] + part * position[k + 1, i]
        state.velocity[i] = rest * velocity[k, i] + part * velocity[k + 1, i]
        state.omega[i] = rest * rate[k, i] + part * rate[k + 1, i]
    q = state.quaternion
    for i in range(4):
        q[i] = rest * attitude[k, i] + part * attitude[k + 1, i]
    q[0], q[1], q[2], q[3] = unit((q[0], q[1], q[2], q[3]))
    state.battery_voltage = rest * voltage[k] + part * voltage[k + 1]


@inner
def _turn_on(state: Any, rate: FloatArray, k: int, part: float) -> None:
    """Body rate `part` of the way from sample `k` to the next, from `k` and earlier samples alone.

    The next sample has the noise of the gyro that is also in the measured angular acceleration: a regressor
    that knows it takes a third off a rate damping (a predictor must not look ahead: Ljung, System
    Identification, 2nd ed. 1999, section 3.2).
    """
    if k >= 2:
        for i in range(3):
            state.omega[i] = rate[k, i] + 0.5 * part * (rate[k, i] - rate[k - 2, i])


@outlined
def _wrench(state: Any, p: Any) -> Wrench:
    """Force (N) and torque (N m) in the body frame, at the placed state."""
    return in_free_flight(state, p)[2]


@outlined
def _felt(state: Any, p: Any) -> tuple[Vector, Vector]:
    """Specific force (m/s2, body) in the middle of the drone, where board and tracked origin are, and the
    angular acceleration (rad/s2, body)."""
    fx, fy, fz, tx, ty, tz = _wrench(state, p)
    w, inertia, centre = state.omega, p.inertia, p.geometric_centre
    gx, gy, gz = gyroscopic_torque(w[0], w[1], w[2], inertia[0], inertia[1], inertia[2])
    turn_up = ((tx + gx) / inertia[0], (ty + gy) / inertia[1], (tz + gz) / inertia[2])
    ax, ay, az = acceleration_beside((centre[0], centre[1], centre[2]), w[0], w[1], w[2], turn_up)
    return (fx / p.mass + ax, fy / p.mass + ay, fz / p.mass + az), turn_up


@outlined
def force_at_sample(state: Any, record: Any, k: int, p: Any) -> tuple[float, float, float]:
    """Force (N, body) at sample `k` of a record, with the motors' thrusts that `state` has."""
    if k == 0:
        _place(state, record, 0, 0.0)
    else:
        _place(state, record, k - 1, 1.0)
    fx, fy, fz, _, _, _ = _wrench(state, p)
    return fx, fy, fz


@outlined
def _follow(state: Any, p: Any, record: Any, dt: float, steps: int, out: Any) -> None:
    """Fill `out`, the arrays of a :class:`Prediction`, along a record."""
    force, acceleration, turn_up, thrust, current, charge = out
    rate, duty = record[3], record[4]
    count = duty.shape[0]
    step = dt / steps
    up, down = decay(p, 0.5 * step)
    ix, iy, iz = p.inertia[0], p.inertia[1], p.inertia[2]
    settle(state, p, duty, record[5])
    for k in range(count):
        last = k == count - 1
        _place(state, record, k - 1 if last else k, 1.0 if last else 0.0)
        felt, turned = _felt(state, p)
        for i in range(3):
            force[k, i], turn_up[k, i] = felt[i], turned[i]
        for motor in range(4):
            thrust[k, motor] = state.thrust[motor]
        current[k] = battery_current(
            p.current_per_newton, state.thrust[0], state.thrust[1], state.thrust[2], state.thrust[3]
        )
        charge[k] = 0.0 if k == 0 else charge[k - 1] + 0.5 * dt * (current[k - 1] + current[k])
        if last:
            break
        sx, sy, sz = 0.0, 0.0, 0.0
        for j in range(steps):
            part = (j + 0.5) / steps
            _place(state, record, k, part)
            _turn_on(state, rate, k, part)
            targets = commanded(state, p, motor_targets(state, p, duty_between(duty, k, part, dt)))
            lag_to_middle(state, p, targets, up, down, 0.5 * step)
            _, _, _, tx, ty, tz = _wrench(state, p)
            wx, wy, wz = state.omega[0], state.omega[1], state.omega[2]
            gx, gy, gz = gyroscopic_torque(wx, wy, wz, ix, iy, iz)
            sx, sy, sz = sx + (tx + gx) / ix, sy + (ty + gy) / iy, sz + (tz + gz) / iz
            lag_to_end(state, p, targets, up, down)
        acceleration[k, 0], acceleration[k, 1], acceleration[k, 2] = sx / steps, sy / steps, sz / steps


def teacher_forced(record: FlightRecord, parameters: Any) -> Prediction:
    """Specific force and angular acceleration that a model gives along a measured flight.

    Commands and voltage are taken as straight lines between samples, as are pose and velocity; commands are
    a little older (:func:`~calibration.gap.replay.kernels.duty_between`), rates those of the past carried on.
    Motors are cold at the first sample.

    Raises:
        CalibrationError: the flight has no battery voltage, so that a command means no thrust.
    """
    count = record.t.size
    out = Prediction(
        np.empty((count, 3)),
        np.empty((count - 1, 3)),
        np.empty((count, 3)),
        np.empty((count, 4)),
        np.empty(count),
        np.empty(count),
    )
    steps = max(1, math.ceil(record.dt / LONGEST_STEP - 1e-6))
    p = parameters.copy()
    set_step(p, record.dt / steps)
    _follow(with_cold_motors(new_state()), p, record.inputs, record.dt, steps, tuple(out))
    return out
