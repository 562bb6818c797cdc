"""Training of the trigger policy: scaler and one-class support vector machine."""

from typing import NamedTuple

import numpy as np

from onboard.arrays import FloatArray
from perchhw.errors import FlightStackError

GAMMA = 2.0
"""Of the radial basis function, in standardised cues; the authors' value (paper errata 6)."""

NU = 0.1
"""Share of the pairs that may lie outside the region; the authors' value (paper errata 6)."""


class TrainingError(FlightStackError):
    """Pairs from which no policy can be trained."""


class Scaler(NamedTuple):
    """Standardisation of the cues for both stages.

    Attributes:
        mean: (3,).
        std: (3,) population standard deviation.
    """

    mean: FloatArray
    std: FloatArray

    def transform(self, states: FloatArray) -> FloatArray:
        """Standardise (n, 3) states."""
        return (states - self.mean) / self.std


class TriggerFit(NamedTuple):
    """A trained trigger policy.

    Attributes:
        support_vectors: (m, 3), standardised.
        dual_coefficients: (m,), each above 0 and at most 1.
        intercept: added to the sum (scikit-learn's ``intercept_``), negative.
        inside_share: share of the training pairs at which it fires.
    """

    support_vectors: FloatArray
    dual_coefficients: FloatArray
    intercept: float
    inside_share: float


def fit_scaler(states: FloatArray) -> Scaler:
    """Mean and population standard deviation of (n, 3) states.

    Raises:
        TrainingError: a cue does not vary.
    """
    mean, std = states.mean(axis=0), states.std(axis=0)
    if not np.all(std > 0):
        raise TrainingError(
            f"the {len(states)} pairs do not vary in every cue (std {std}); give more conditions"
        )
    return Scaler(mean, std)


def fit_trigger(scaled_states: FloatArray, *, gamma: float = GAMMA, nu: float = NU) -> TriggerFit:
    """Fit the region of good trigger states.

    The decision value is ``sum_i alpha_i exp(-gamma |x - s_i|^2) + b`` (paper Eq. OC-SVM with the bias inside
    the sign, errata 6). The fit is convex: it needs no seed.

    Args:
        scaled_states: (n, 3), standardised.
        gamma: above 0.
        nu: within (0, 1).

    References:
        B. Schoelkopf et al., "Estimating the support of a high-dimensional distribution", Neural Computation
        13 (2001).
    """
    from sklearn.svm import OneClassSVM

    machine = OneClassSVM(kernel="rbf", gamma=gamma, nu=nu).fit(scaled_states)
    return TriggerFit(
        support_vectors=np.asarray(machine.support_vectors_, np.float64),
        dual_coefficients=np.asarray(machine.dual_coef_[0], np.float64),
        intercept=float(machine.intercept_[0]),
        inside_share=float(np.mean(machine.decision_function(scaled_states) >= 0)),
    )
