"""The physics of the simulation along measured inputs, from every start: compiled.

Inputs between two samples are interpolated linearly (commands as :func:`duty_between` says) and taken in the
middle of a step. Nothing touches a surface here: records are cut to free flight before.
"""

from typing import Any

from onboard.mixer import Thrusts
from sim_backend.physics.battery import motor_targets
from sim_backend.physics.frames import Wrench, to_world
from sim_backend.physics.jit import inner, kernel, outlined
from sim_backend.physics.motors import commanded, decay, lag_to_end, lag_to_middle
from sim_backend.physics.state import COMMAND_MEMORY
from sim_backend.physics.step import drift_to_end, drift_to_middle, in_free_flight, inverse_inertia, kick

HELD = 1e-3
"""s: commands are steps of 2 ms (the controller runs at 500 Hz), logged when they are fresh; a line through
the logged ones is therefore half a step ahead of what the motors were told."""


@kernel
def duty_between(duty: Any, row: int, share: float, dt: float) -> Thrusts:
    """Duties that the motors have at `share` (0..1) of the way from sample `row` to the next.

    They are :data:`HELD` older than a line through the samples.

    Args:
        duty: shape (n, 4), at the samples.
        row, share: when.
        dt: s, sample interval.
    """
    late = share - HELD / dt
    if late < 0.0 and row > 0:
        row, late = row - 1, late + 1.0
    a, b = duty[row], duty[row + 1]
    return (
        a[0] + late * (b[0] - a[0]),
        a[1] + late * (b[1] - a[1]),
        a[2] + late * (b[2] - a[2]),
        a[3] + late * (b[3] - a[3]),
    )


Trim = tuple[float, float, float, float, float]
"""What a flight has beside its model: lean of the thrust towards b_x and b_y (rad, small), and constant
angular acceleration about the body axes (rad/s2)."""

TRIMS = 5
"""Numbers of a :data:`Trim`."""


@inner
def interpolated(values: Any, row: int, share: float, column: int) -> float:
    """Linear between the samples `row` and the next."""
    here = values[row, column]
    return here + share * (values[row + 1, column] - here)


@inner
def targets_between(
    state: Any, p: Any, duty: Any, voltage: Any, row: int, share: float, dt: float
) -> Thrusts:
    """Thrusts (N) that the motors head for at `share` (0..1) of the way from sample `row` to the next.

    Leaves the battery voltage of that moment in the state. `dt`: s, sample interval.
    """
    state.battery_voltage = voltage[row] + share * (voltage[row + 1] - voltage[row])
    return commanded(state, p, motor_targets(state, p, duty_between(duty, row, share, dt)))


@inner
def copy_motors(source: Any, target: Any) -> None:
    """Everything of a state that belongs to the motors."""
    target.command_count = source.command_count
    for motor in range(4):
        target.thrust[motor] = source.thrust[motor]
        target.rotor_speed[motor] = source.rotor_speed[motor]
        target.rotor_acceleration[motor] = source.rotor_acceleration[motor]
        target.coldness[motor] = source.coldness[motor]
    for slot in range(COMMAND_MEMORY):
        for motor in range(4):
            target.command_memory[slot, motor] = source.command_memory[slot, motor]


@outlined
def follow_duty(
    state: Any, p: Any, duty: Any, voltage: Any, substeps: int, h: float, starts: Any, start_rows: Any,
    thrust: Any,
) -> None:  # fmt: skip
    """Run the motors along the whole log; nothing else moves.

    Args:
        state: fresh; its motors begin settled at the first command.
        p: parameters.
        duty: shape (n, 4). voltage: V, shape (n,).
        substeps: steps from one sample to the next. h: s, one step.
        starts: states that receive the motors as they are at `start_rows` (increasing).
        thrust: N, shape (n, 4), receives the thrusts at the samples.
    """
    up, down = decay(p, 0.5 * h)
    settle(state, p, duty, voltage)
    count, following = duty.shape[0], 0
    for row in range(count):
        for motor in range(4):
            thrust[row, motor] = state.thrust[motor]
        if following < start_rows.size and start_rows[following] == row:
            copy_motors(state, starts[following])
            following += 1
        if row == count - 1:
            break
        for j in range(substeps):
            targets = targets_between(state, p, duty, voltage, row, (j + 0.5) / substeps, substeps * h)
            lag_to_middle(state, p, targets, up, down, 0.5 * h)
            lag_to_end(state, p, targets, up, down)


@kernel
def settle(state: Any, p: Any, duty: Any, voltage: Any) -> None:
    """Motors that have had the first command for long (a delay has no past before it)."""
    state.battery_voltage = voltage[0]
    targets = motor_targets(state, p, duty[0])
    for motor in range(4):
        state.thrust[motor] = targets[motor]


@kernel
def trimmed(p: Any, wrench: Wrench, trim: Trim) -> Wrench:
    """The wrench with the trim of the flight."""
    return (
        wrench[0] + trim[0] * wrench[2],
        wrench[1] + trim[1] * wrench[2],
        wrench[2],
        wrench[3] + trim[2] * p.inertia[0],
        wrench[4] + trim[3] * p.inertia[1],
        wrench[5] + trim[4] * p.inertia[2],
    )


@kernel
def free_step(state: Any, p: Any, targets: Thrusts, trim: Trim, h: float, up: float, down: float) -> None:
    """``sim_backend.physics.step.free_substep`` with the trim of the flight."""
    drift_to_middle(state, 0.5 * h)
    lag_to_middle(state, p, targets, up, down, 0.5 * h)
    rot, _, wrench = in_free_flight(state, p)
    kick(state, p, rot, inverse_inertia(p), trimmed(p, wrench, trim), h)
    lag_to_end(state, p, targets, up, down)
    drift_to_end(state, 0.5 * h)


@kernel
def set_attitude(state: Any, quaternion: Any, rate: Any, row: int, share: float) -> None:
    """Give the state the measured attitude and rate at `share` of the way to the next sample."""
    q = state.quaternion
    for i in range(4):
        q[i] = interpolated(quaternion, row, share, i)
    scale = 1.0 / (q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]) ** 0.5
    for i in range(4):
        q[i] *= scale
    for i in range(3):
        state.omega[i] = interpolated(rate, row, share, i)


@kernel
def translate(state: Any, p: Any, targets: Thrusts, trim: Trim, h: float, up: float, down: float) -> None:
    """One step of position and velocity alone, at the attitude and rate of the middle of the step."""
    position, velocity = state.position, state.velocity
    for i in range(3):
        position[i] += 0.5 * h * velocity[i]
    lag_to_middle(state, p, targets, up, down, 0.5 * h)
    rot, _, wrench = in_free_flight(state, p)
    force = trimmed(p, wrench, trim)
    fx, fy, fz = to_world(rot, force[0], force[1], force[2])
    per_mass = h / p.mass
    velocity[0] += per_mass * fx
    velocity[1] += per_mass * fy
    velocity[2] += per_mass * fz - h * p.gravity
    lag_to_end(state, p, targets, up, down)
    for i in range(3):
        position[i] += 0.5 * h * velocity[i]


@kernel
def keep(state: Any, out: Any) -> None:
    """Position, velocity, quaternion and rate of a state, 13 numbers."""
    for i in range(3):
        out[i] = state.position[i]
        out[3 + i] = state.velocity[i]
        out[10 + i] = state.omega[i]
    for i in range(4):
        out[6 + i] = state.quaternion[i]


@outlined
def predict(
    starts: Any, rows: Any, lengths: Any, ends: Any, trims: Any, p: Any, duty: Any, voltage: Any,
    quaternion: Any, rate: Any, given_attitude: bool, substeps: int, h: float, out: Any,
) -> None:  # fmt: skip
    """Fly the model from every start.

    Args:
        starts: states with pose, velocities and motors of the starts; changed.
        rows: sample of each start, shape (m,). lengths: samples that each may fly, shape (m,).
        ends: samples after the start at which the state is kept, increasing, shape (h,).
        trims: of each start, shape (m, 5), see :data:`Trim`.
        p: parameters.
        duty, voltage, quaternion, rate: measured, shapes (n, 4), (n,), (n, 4), (n, 3).
        given_attitude: attitude and rate are the measured ones; only position and velocity are predicted.
        substeps, h: steps from one sample to the next, and their length (s).
        out: shape (m, h, 13), see :func:`keep`; what lies beyond a length is left as it is.
    """
    up, down = decay(p, 0.5 * h)
    for i in range(rows.size):
        state = starts[i]
        trim = (trims[i, 0], trims[i, 1], trims[i, 2], trims[i, 3], trims[i, 4])
        horizon = 0
        for ahead in range(lengths[i]):
            row = rows[i] + ahead
            for j in range(substeps):
                share = (j + 0.5) / substeps
                targets = targets_between(state, p, duty, voltage, row, share, substeps * h)
                if given_attitude:
                    set_attitude(state, quaternion, rate, row, share)
                    translate(state, p, targets, trim, h, up, down)
                else:
                    free_step(state, p, targets, trim, h, up, down)
            if horizon < ends.size and ahead + 1 == ends[horizon]:
                keep(state, out[i, horizon])
                horizon += 1
