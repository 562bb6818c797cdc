"""Compiled: one landing flown by the simulation, its misfit to the samples, and the best start state.

A landing is flown from a state just before the first contact at 1 ms (:func:`fly`). The start is known only
within the noise of the measurement, so eleven nuisances x, in units of their prior standard deviations, may
move it (:func:`displace`). The misfit of a vehicle is the least, over x, of

    x . x + sum of rho(r),    rho(r) = C2 log(1 + r^2 / C2),

r being residuals of gyro, attitude and position over their standard deviations. rho (Lorentz, or Cauchy)
lets a landing that goes its own way after a crash of the hull count by what came before. The minimum is found
by Levenberg-Marquardt steps from several starts, because which foot touches next is not smooth in x.
"""

from typing import Any, NamedTuple

import numpy as np

from onboard.rotation import multiply
from sim_backend.physics.jit import alone, inner, kernel
from sim_backend.physics.motors import commanded, decay, lag_to_end, lag_to_middle
from sim_backend.physics.step import advance

DT = 1e-3
"""s, step of the physics."""

NUISANCES = 11
"""Ceiling height (m), velocity (3, m/s, world), attitude (3, rad, body), rate (3, rad/s, body), and how much
later the gyro's clock is than the pose's (s)."""

OMEGA, QUATERNION, POSITION, BODY = 0, 3, 7, 10
COLUMNS = 11
"""Columns of a trace: rate (3), quaternion (4), position (3), hull touched."""

C2 = 9.0
"""Square of the residual (in standard deviations) from which on rho grows slowly."""

PROBE = 0.2
"""Step of the numerical derivatives, in prior standard deviations."""


@alone
def spin(state: Any, p: Any, targets: Any) -> None:
    """Let only the motors of `state` follow `targets` (N, shape (n, 4)), one row a step."""
    up, down = decay(p, 0.5 * DT)
    for k in range(targets.shape[0]):
        delayed = commanded(state, p, (targets[k, 0], targets[k, 1], targets[k, 2], targets[k, 3]))
        lag_to_middle(state, p, delayed, up, down, 0.5 * DT)
        lag_to_end(state, p, delayed, up, down)


@inner
def note(state: Any, row: Any) -> None:
    """Write a state into one row of a trace."""
    for i in range(3):
        row[OMEGA + i] = state.omega[i]
        row[POSITION + i] = state.position[i]
    for i in range(4):
        row[QUATERNION + i] = state.quaternion[i]
    row[BODY] = state.body_contact


@alone
def fly(state: Any, p: Any, targets: Any, parts: int, trace: Any) -> None:
    """Fly `state` with thrust targets (N, (n, 4)), each held for 1 ms.

    Args:
        state, p: records.
        targets: (n, 4).
        parts: steps of the physics in 1 ms; 1 is what all of perchhw simulates with.
        trace: (n + 1, COLUMNS), receives the state every 1 ms.
    """
    dt = DT / parts
    up, down = decay(p, 0.5 * dt)
    note(state, trace[0])
    for k in range(targets.shape[0]):
        for _ in range(parts):
            advance(state, p, (targets[k, 0], targets[k, 1], targets[k, 2], targets[k, 3]), dt, up, down)
        note(state, trace[k + 1])


@kernel
def displace(state: Any, p: Any, x: Any, sigma: Any) -> None:
    """Move a start state and the ceiling of `p` by the nuisances x (in units of `sigma`)."""
    p.ceiling_z += x[0] * sigma[0]
    for i in range(3):
        state.velocity[i] += x[1 + i] * sigma[1 + i]
        state.omega[i] += x[7 + i] * sigma[7 + i]
    turn = (0.5 * x[4] * sigma[4], 0.5 * x[5] * sigma[5], 0.5 * x[6] * sigma[6], 1.0)
    q = multiply(state.quaternion, turn)
    size = np.sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3])
    for i in range(4):
        state.quaternion[i] = q[i] / size


@inner
def place_in(trace: Any, t: float) -> tuple[int, float]:
    """Row of a trace before the time t (s), and the share of the step after it."""
    at = min(max(t / DT, 0.0), trace.shape[0] - 1.001)
    row = int(at)
    return row, at - row


@alone
def gyro_residuals(trace: Any, gyro: Any, weight: Any, delay: float, limit: float, out: Any) -> None:
    """(measured - predicted) x weight of a gyro with range `limit` (rad/s), into `out` ((m, 3)).

    Args:
        trace: of :func:`fly`.
        gyro: (m, 4): time since the start (s) on the gyro's clock, and the rates (rad/s).
        weight: (m, 3), one over the standard deviations; 0 where a value is missing.
        delay: s, the gyro's clock behind the trace's.
        limit: rad/s.
        out: receives the residuals.
    """
    for k in range(gyro.shape[0]):
        row, share = place_in(trace, gyro[k, 0] - delay)
        for i in range(3):
            value = trace[row, OMEGA + i] + share * (trace[row + 1, OMEGA + i] - trace[row, OMEGA + i])
            out[k, i] = weight[k, i] * (gyro[k, 1 + i] - min(max(value, -limit), limit))


@alone
def pose_residuals(trace: Any, pose: Any, weight: Any, out: Any) -> None:
    """Attitude (body, rad) and position (m), measured - predicted, x weight, into `out` ((m, 6)).

    Args:
        trace: of :func:`fly`.
        pose: (m, 8): time since the start (s), quaternion, position (m).
        weight: (m, 2), one over the standard deviations of attitude and position.
        out: receives the residuals.
    """
    for k in range(pose.shape[0]):
        row, share = place_in(trace, pose[k, 0])
        a, b = trace[row], trace[row + 1]
        # Within a step of 1 ms the quaternions are close enough to mix.
        x = a[3] + share * (b[3] - a[3])
        y = a[4] + share * (b[4] - a[4])
        z = a[5] + share * (b[5] - a[5])
        w = a[6] + share * (b[6] - a[6])
        turn = multiply((-x, -y, -z, w), (pose[k, 1], pose[k, 2], pose[k, 3], pose[k, 4]))
        sine = np.sqrt(turn[0] * turn[0] + turn[1] * turn[1] + turn[2] * turn[2])
        angle = 2.0 * np.arctan2(sine, abs(turn[3]))
        scale = weight[k, 0] * (angle / sine if sine > 1e-12 else 2.0) * (1.0 if turn[3] >= 0.0 else -1.0)
        for i in range(3):
            out[k, i] = scale * turn[i]
            place = a[POSITION + i] + share * (b[POSITION + i] - a[POSITION + i])
            out[k, 3 + i] = weight[k, 1] * (pose[k, 5 + i] - place)


class Seen(NamedTuple):
    """What was seen of a landing.

    Attributes:
        gyro, gyro_weight: of :func:`gyro_residuals`. limit: rad/s, range of the gyro.
        pose, pose_weight: of :func:`pose_residuals`.
    """

    gyro: Any
    gyro_weight: Any
    limit: float
    pose: Any
    pose_weight: Any


class Case(NamedTuple):
    """A landing and a vehicle, as the kernels take them.

    Attributes:
        start: states (1,) to start from. parameters: (1,), with the ceiling of the prior mean.
        states, changed: (1,) each, scratch.
        targets: (steps, 4), N. parts: steps of the physics in 1 ms.
        sigma: (NUISANCES,), standard deviations of the prior.
        trace: (steps + 1, COLUMNS), scratch.
    """

    start: Any
    parameters: Any
    states: Any
    changed: Any
    targets: Any
    parts: int
    sigma: Any
    seen: Seen
    trace: Any


@alone
def residuals(x: Any, case: Any, out: Any) -> None:
    """Residuals of a landing with the nuisances x into `out` ((3 gyro rows + 6 pose rows,))."""
    case.states[0] = case.start[0]
    case.changed[0] = case.parameters[0]
    displace(case.states[0], case.changed[0], x, case.sigma)
    fly(case.states[0], case.changed[0], case.targets, case.parts, case.trace)
    seen = case.seen
    split = 3 * seen.gyro.shape[0]
    delay = x[10] * case.sigma[10]
    gyro_residuals(case.trace, seen.gyro, seen.gyro_weight, delay, seen.limit, out[:split].reshape(-1, 3))
    pose_residuals(case.trace, seen.pose, seen.pose_weight, out[split:].reshape(-1, 6))


@inner
def cost_of(x: Any, r: Any) -> float:
    """Prior and robust misfit; infinite where a number is none."""
    total = 0.0
    for value in x:
        total += value * value
    for value in r:
        total += C2 * np.log1p(value * value / C2)
    return total if np.isfinite(total) else np.inf


@inner
def count_of(case: Any) -> int:
    """Number of residuals."""
    return 3 * int(case.seen.gyro.shape[0]) + 6 * int(case.seen.pose.shape[0])


@inner
def copy_into(target: Any, source: Any) -> None:
    """`target` is from now on as `source`; both (n,)."""
    for i in range(len(target)):
        target[i] = source[i]


@inner
def solve(matrix: Any, right: Any, out: Any) -> None:
    """Into `out` the x of A x = `right`, A symmetric, positive definite; its lower half becomes L of L L^T.

    numpy's solver takes seconds to compile.
    """
    n = len(right)
    for i in range(n):
        for j in range(i + 1):
            rest = matrix[i, j]
            for k in range(j):
                rest -= matrix[i, k] * matrix[j, k]
            matrix[i, j] = rest / matrix[j, j] if j < i else np.sqrt(rest)
    for i in range(n):
        rest = right[i]
        for k in range(i):
            rest -= matrix[i, k] * out[k]
        out[i] = rest / matrix[i, i]
    for i in range(n - 1, -1, -1):
        rest = out[i]
        for k in range(i + 1, n):
            rest -= matrix[k, i] * out[k]
        out[i] = rest / matrix[i, i]


@inner
def least_of(values: Any) -> int:
    """Index of the first of the least values (n,)."""
    least = 0
    for i in range(1, len(values)):
        if values[i] < values[least]:
            least = i
    return least


@alone
def descend(x: Any, iterations: int, case: Any) -> float:
    """Levenberg-Marquardt from x, which it improves in place; returns the cost.

    A vehicle too stiff for the step of the physics has no finite residuals there: from such a start nothing
    is descended, its cost is infinite; a nuisance that leads to one stays where it is.
    """
    m = count_of(case)
    r, moved, slope = np.empty(m), np.empty(m), np.empty((m, NUISANCES))
    trial = np.empty(NUISANCES)
    residuals(x, case, r)
    cost, damping = cost_of(x, r), 0.1
    if cost == np.inf:
        return cost
    for _ in range(iterations):
        for j in range(NUISANCES):
            probe = x.copy()
            probe[j] += PROBE
            residuals(probe, case, moved)
            slope[:, j] = 0.0
            if cost_of(probe, moved) < np.inf:
                for i in range(m):  # here and below: arrays assigned to slices take seconds to compile
                    slope[i, j] = (moved[i] - r[i]) / PROBE
        weighted = slope.T * (1.0 / (1.0 + r * r / C2))
        normal = weighted @ slope
        for j in range(NUISANCES):
            normal[j, j] += 1.0
        gradient = weighted @ r + x
        better = False
        for _ in range(3):
            matrix = normal.copy()
            for j in range(NUISANCES):
                matrix[j, j] *= 1.0 + damping
            solve(matrix, gradient, trial)
            for j in range(NUISANCES):
                trial[j] = x[j] - trial[j]
            residuals(trial, case, moved)
            new = cost_of(trial, moved)
            if new < cost:
                better = cost - new > 1e-3 * cost
                cost = new
                copy_into(x, trial)
                copy_into(r, moved)
                damping *= 0.2
                break
            damping *= 8.0
        if not better:
            break
    return cost


@alone
def best_start(starts: Any, keep: int, iterations: int, case: Any, x: Any) -> float:
    """Least cost over x: all `starts` are tried, and the `keep` best of them descended from.

    Args:
        starts: (s, NUISANCES).
        keep: number of descents. iterations: of each.
        case: the landing.
        x: receives the best nuisances.
    """
    r, costs = np.empty(count_of(case)), np.empty(starts.shape[0])
    for s in range(starts.shape[0]):
        residuals(starts[s], case, r)
        costs[s] = cost_of(starts[s], r)
    least = np.inf
    for _ in range(min(keep, len(costs))):
        s = least_of(costs)
        costs[s] = np.inf
        trial = starts[s].copy()
        cost = descend(trial, iterations, case)
        if cost < least:
            least = cost
            copy_into(x, trial)
    return least
