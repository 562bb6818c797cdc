"""Uncertainty of parameters that several steps share, from how much the steps disagree.

What one fit calls its error is the noise of samples that are taken as independent. They are not: revolutions
share their edges, a step's temperature and battery are its own. So the covariance comes from the scores of
whole steps, with the CR2 correction and the degrees of freedom of Bell and McCaffrey (Survey Methodology
28(2), 2002; Imbens and Kolesar, Review of Economics and Statistics 98(4), 2016).

Each step's own parameters (begin, speeds before and after) are projected out first.
"""

from dataclasses import dataclass

import numpy as np

from calibration.bench.motors.records import IntArray
from onboard.arrays import FloatArray

FEWEST_STEPS = 6
"""Below it, steps cannot say how much they disagree: the residuals' covariance is used, with few dof."""


@dataclass(frozen=True, slots=True)
class SharedCovariance:
    """Covariance of p shared parameters from S steps.

    Attributes:
        information: (S, p, p) of each step alone, in units of the residuals' variance.
        scores: (S, p) gradient of each step's sum of squares.
        residual_variance: of one weighted residual.
    """

    information: FloatArray
    scores: FloatArray
    residual_variance: float

    @property
    def formal(self) -> FloatArray:
        """(p, p) covariance if all residuals were independent."""
        return np.asarray(np.linalg.inv(self.information.sum(axis=0)) * self.residual_variance)

    def of(self, gradient: FloatArray) -> tuple[float, float]:
        """Standard uncertainty and degrees of freedom of a quantity; `gradient` (p,) by the parameters."""
        steps = self.information.shape[0]
        if steps < FEWEST_STEPS:
            return float(np.sqrt(gradient @ self.formal @ gradient)), float(max(steps - 1, 0))
        inverse = np.linalg.inv(self.information.sum(axis=0))
        rows = np.array([gradient @ inverse @ _correction(one, inverse) for one in self.information])
        variance = float(np.sum(np.sum(rows * self.scores, axis=1) ** 2))
        return float(np.sqrt(variance)), self._freedom(rows, inverse)

    def _freedom(self, rows: FloatArray, inverse: FloatArray) -> float:
        """Satterthwaite's degrees of freedom, with residuals taken as independent."""
        own = np.array([row @ one for row, one in zip(rows, self.information, strict=True)])
        expected = np.diag(np.sum(own * rows, axis=1)) - own @ inverse @ own.T
        return float(np.trace(expected) ** 2 / np.sum(expected**2))


def _correction(information: FloatArray, inverse: FloatArray) -> FloatArray:
    """The matrix A with A (H - H M^-1 H) A' = H: undoes what the fit took from a step's residuals."""
    root = _root(information)
    shrunk = np.eye(len(root)) - root @ inverse @ root
    values, vectors = np.linalg.eigh(shrunk)
    # A step that alone decides a direction leaves no residual there: nothing to correct.
    factors = np.where(values > 1e-6, 1.0 / np.sqrt(np.maximum(values, 1e-6)), 1.0)
    return np.asarray(root @ (vectors * factors) @ vectors.T @ np.linalg.pinv(root))


def _root(matrix: FloatArray) -> FloatArray:
    values, vectors = np.linalg.eigh(matrix)
    return np.asarray((vectors * np.sqrt(np.maximum(values, 0.0))) @ vectors.T)


def shared_covariance(
    jacobian: FloatArray, residuals: FloatArray, step_of: IntArray, shared: int
) -> SharedCovariance:
    """From a weighted fit.

    Args:
        jacobian: (n, k) of the weighted residuals: the shared parameters first, then each step's own.
        residuals: (n,) weighted.
        step_of: (n,) index of the step of each sample.
        shared: number of shared parameters.
    """
    steps = int(step_of.max()) + 1
    information = np.zeros((steps, shared, shared))
    scores = np.zeros((steps, shared))
    for step in range(steps):
        rows = step_of == step
        common = jacobian[rows, :shared]
        own = jacobian[rows, shared:]
        own = own[:, np.any(own != 0.0, axis=0)]
        basis, _ = np.linalg.qr(own)
        common = common - basis @ (basis.T @ common)
        information[step] = common.T @ common
        scores[step] = common.T @ residuals[rows]
    freedom = max(residuals.size - jacobian.shape[1], 1)
    return SharedCovariance(information, scores, float(residuals @ residuals) / freedom)
