"""The linear equations that tracked attitude and gyro give about a state, and their Bayesian solution.

With A the attitude from the integral of the corrected gyro, M the tracked attitude taken at the delayed time
and turned back by the rotation found so far, the rotation vector of A^-1 M is to first order

    phi(t) = dr - dd(t) w(t) - A^T (W(t) + integral of A db)

dr: change of the turn of the tracked frame; dd: of the path of the delay; db: of the bias of the gyro; W: of
the random walk (world frame) that the noise of the gyro adds up to.
"""

from dataclasses import dataclass, replace

import numpy as np
from scipy import sparse
from scipy.linalg import cho_factor, cho_solve

from calibration.gap.data.kinematics import pose_at
from calibration.gap.data.record import FlightRecord
from calibration.gap.data.rotations import (
    conjugates,
    integrate_rate,
    matrices,
    products,
    rotation_vectors,
    turned,
)
from calibration.gap.sensors.knots import block_means, cells, hats, knots_over
from onboard.arrays import BoolArray, FloatArray

_DELAY_KNOT_S = 0.5
_DRIFT_KNOT_S = 0.5
_BLOCK_S = 0.04  # samples are averaged over this: what is quicker, gyro and tracking resolve differently
_WANDER_TIME_S = 3.0
_DELAY_PRIOR_S = 0.1
_TURN_PRIOR = 0.5  # rad
_BIAS_PRIOR = 0.5  # rad/s
_LEAST_NOISE = 2e-4  # rad
_LOST_RATE = 0.5  # rad/s by which an interpolated gyro may be off


@dataclass(frozen=True)
class LinearisationPoint:
    """A point to linearise about, and the spreads of the priors.

    Attributes:
        path: s, delay at its knots, shape (k,).
        rotation: rad, shape (3,).
        bias: rad/s, shape (3,).
        correction: rad/s, body, of the gyro by the random walk so far, shape (n, 3).
        steps: rad, world, of that walk between its knots, shape (d - 1, 3).
        noise: rad, of one tracked attitude.
        walk: rad per root s.
        wander: s, standard deviation of the path about its level.
    """

    path: FloatArray
    rotation: FloatArray
    bias: FloatArray
    correction: FloatArray
    steps: FloatArray
    noise: float
    walk: float
    wander: float


@dataclass(frozen=True)
class Solution:
    """The most likely change of a state.

    Attributes:
        at: the state about which it holds.
        likelihood: log of the marginal likelihood of `at`'s spreads, but for a constant.
        change: path (k), rotation (3), bias (3), walk (3 d).
        factor: Cholesky factor of the precision of `change`.
    """

    at: LinearisationPoint
    likelihood: float
    change: FloatArray
    factor: tuple[FloatArray, bool]


def delay_knots(record: FlightRecord) -> FloatArray:
    """Times (s) of the knots of the delay, shape (k,)."""
    return knots_over(record.t, _DELAY_KNOT_S)


def first_state(
    record: FlightRecord, path: FloatArray, noise: float, walk: float, wander: float
) -> LinearisationPoint:
    """A state whose random walk takes the integrated gyro from tracked attitude to tracked attitude.

    So it stays small to linearise about, whatever happens in gaps; the fit takes back what is not needed.
    """
    knots = knots_over(record.t, _DRIFT_KNOT_S)
    _, tracked, _ = pose_at(record, record.t + hats(record.t, delay_knots(record)) @ path)
    gyro = integrate_rate(record.rate, record.dt)
    at = np.searchsorted(record.t, knots - 0.5 * record.dt).clip(0, record.t.size - 1)
    predicted = products(tracked[at[:-1]], products(conjugates(gyro[at[:-1]]), gyro[at[1:]]))
    steps = rotation_vectors(products(tracked[at[1:]], conjugates(predicted)))
    correction = _body_rates(steps, tracked, record.t, knots)
    return LinearisationPoint(path, np.zeros(3), np.zeros(3), correction, steps, noise, walk, wander)


class AttitudeEquations:
    """The equations of one flight about the path, rotation, bias and random walk of a state."""

    def __init__(self, record: FlightRecord, used: BoolArray, state: LinearisationPoint) -> None:
        self._record = record
        self._hats = hats(record.t, delay_knots(record))
        self._knots = knots_over(record.t, _DRIFT_KNOT_S)
        self._drift_hats = hats(record.t, self._knots)
        self._lost = ~used
        _, attitude, known = pose_at(record, record.t + self._hats @ state.path)
        tracked = turned(attitude, -state.rotation)
        gyro = integrate_rate(record.rate - state.bias + state.correction, record.dt)
        start = int(np.argmax(used & known))
        offset = products(tracked[start : start + 1], conjugates(gyro[start : start + 1]))
        self._attitude = products(np.broadcast_to(offset, gyro.shape), gyro)
        self._rows = np.flatnonzero(used & known)
        self._phi = rotation_vectors(products(conjugates(self._attitude), tracked))[self._rows]
        frames = matrices(self._attitude)
        area = np.zeros_like(frames)
        area[1:] = np.cumsum(0.5 * (frames[1:] + frames[:-1]) * record.dt, axis=0)
        self._back = np.swapaxes(frames, 1, 2)
        self._bias_columns = -self._back @ area
        self._sum_up(state)

    def _sum_up(self, state: LinearisationPoint) -> None:
        """Normal equations for unit noise; rows are block means, axis by axis."""
        means = block_means(self._rows, max(round(_BLOCK_S / self._record.dt), 1))
        rate = (self._record.rate - state.bias)[self._rows]
        path, drift = self._hats[self._rows], self._drift_hats[self._rows]
        blocks = []
        for axis in range(3):
            turn = np.zeros((self._rows.size, 3))
            turn[:, axis] = 1.0
            fixed = sparse.csr_matrix(np.hstack([turn, self._bias_columns[self._rows, axis]]))
            walks = [drift.multiply(-self._back[self._rows, axis, k : k + 1]) for k in range(3)]
            late = path.multiply(-rate[:, axis : axis + 1])
            blocks.append(means @ sparse.hstack([late, fixed, *walks], format="csr"))
        columns = sparse.vstack(blocks, format="csr")
        target = (means @ self._phi).T.ravel()
        counts = np.tile(1.0 / np.asarray(means.power(2).sum(axis=1)).ravel(), 3)
        weighted = columns.multiply(counts[:, None]).tocsr()
        self._normal = (weighted.T @ columns).toarray()
        self._right = weighted.T @ target
        self._square = float(counts @ target**2)
        self._equations = target.size

    def quick_noise(self) -> float:
        """Noise of one tracked attitude (rad), robustly from its change between samples."""
        ends = np.flatnonzero(np.diff(self._rows) == 1)
        change = np.abs(self._phi[ends + 1] - self._phi[ends])
        return max(float(np.sqrt(0.5 * np.mean((np.median(change, axis=0) / 0.6745) ** 2))), _LEAST_NOISE)

    def solve(self, state: LinearisationPoint) -> Solution:
        """The most likely change, with the spreads of `state`, which differs in nothing else."""
        precision, pull, log_prior = self._prior(state)
        right = self._right / state.noise**2 + pull
        factor = cho_factor(self._normal / state.noise**2 + precision, lower=True, check_finite=False)
        change = cho_solve(factor, right, check_finite=False)
        likelihood = (
            log_prior
            + 0.5 * (float(right @ change) - self._square / state.noise**2)
            - float(np.sum(np.log(np.diag(factor[0]))))
            - self._equations * float(np.log(state.noise))
        )
        return Solution(state, likelihood, change, factor)

    def moved(self, solution: Solution) -> LinearisationPoint:
        """The state after the change."""
        k = self._hats.shape[1]
        change, state = solution.change, solution.at
        steps = np.diff(change[k + 6 :].reshape(3, -1).T, axis=0)
        return replace(
            state,
            path=state.path + change[:k],
            rotation=state.rotation + change[k : k + 3],
            bias=state.bias + change[k + 3 : k + 6],
            steps=state.steps - steps,
            correction=state.correction - _body_rates(steps, self._attitude, self._record.t, self._knots),
        )

    def attitude(self, solution: Solution) -> FloatArray:
        """Attitude by gyro and tracking together, after the change; shape (n, 4)."""
        k = self._hats.shape[1]
        walk = self._drift_hats @ solution.change[k + 6 :].reshape(3, -1).T
        turn = np.einsum("nij,nj->ni", -self._back, walk)
        return turned(self._attitude, turn + self._bias_columns @ solution.change[k + 3 : k + 6])

    def covariance(self, solution: Solution) -> FloatArray:
        """Covariance of path, rotation and bias, shape (k + 6, k + 6)."""
        k = self._hats.shape[1]
        unit = np.eye(solution.change.size)[:, : k + 6]
        return np.asarray(cho_solve(solution.factor, unit, check_finite=False)[: k + 6])

    def _prior(self, state: LinearisationPoint) -> tuple[FloatArray, FloatArray, float]:
        """Precision of the unknowns, its product with their prior mean, and the log of its density at 0."""
        k, d = self._hats.shape[1], self._drift_hats.shape[1]
        size = k + 6 + 3 * d
        path = _path_precision(k, state.wander)
        sizes = self._walk_sizes(state.walk)[:, None]
        walk = np.diff(np.eye(d), axis=0) / sizes
        drift = walk.T @ walk + 1e-6 * np.eye(d)
        done = state.steps / sizes
        precision, pull = np.zeros((size, size)), np.zeros(size)
        precision[:k, :k] = path
        pull[:k] = -path @ state.path
        fixed = np.concatenate([np.full(3, _TURN_PRIOR**-2.0), np.full(3, _BIAS_PRIOR**-2.0)])
        precision[range(k, k + 6), range(k, k + 6)] = fixed
        pull[k : k + 6] = -fixed * np.concatenate([state.rotation, state.bias])
        for axis in range(3):
            at = slice(k + 6 + axis * d, k + 6 + (axis + 1) * d)
            precision[at, at] = drift
            pull[at] = walk.T @ done[:, axis]
        log_volume = 0.5 * float(np.linalg.slogdet(path)[1]) + 1.5 * float(np.linalg.slogdet(drift)[1])
        return precision, pull, log_volume - 0.5 * float(state.path @ path @ state.path + np.sum(done**2))

    def _walk_sizes(self, walk: float) -> FloatArray:
        """Standard deviation (rad) of the drift between its knots; large where the gyro was not known."""
        cell = cells(self._record.t, self._knots)
        lost = np.bincount(cell, weights=self._lost, minlength=self._knots.size - 1) * self._record.dt
        return np.asarray(np.sqrt(walk**2 * np.diff(self._knots) + (_LOST_RATE * lost) ** 2))


def _path_precision(count: int, wander: float) -> FloatArray:
    """Precision of an Ornstein-Uhlenbeck path about an unknown level."""
    keep = np.exp(-_DELAY_KNOT_S / _WANDER_TIME_S)
    steps = (np.eye(count)[1:] - keep * np.eye(count)[:-1]) / (wander * np.sqrt(1.0 - keep * keep))
    precision = steps.T @ steps
    precision[0, 0] += wander**-2.0
    pulls = precision.sum(axis=0)
    return np.asarray(precision - np.outer(pulls, pulls) / (pulls.sum() + _DELAY_PRIOR_S**-2.0))


def _body_rates(steps: FloatArray, attitude: FloatArray, t: FloatArray, knots: FloatArray) -> FloatArray:
    """Rates (rad/s, body), shape (n, 3), that make the world-frame rotations `steps` between `knots`."""
    rates = (steps / np.diff(knots)[:, None])[cells(t, knots)]
    return np.asarray(np.einsum("nji,nj->ni", matrices(attitude), rates))
