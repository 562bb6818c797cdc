"""Trigger policy: the one-class support vector machine that decides when to flip, as the drone computes it.

Single precision throughout, terms added in the order of the bundle; ``docs/policy_bundle.md`` states the same
arithmetic for a C implementation.
"""

import math

import numpy as np
from numpy.typing import NDArray

from onboard.jit import kernel
from onboard.policy.model import CompiledPolicy


@kernel
def trigger_value(policy: CompiledPolicy, tau: float, theta_x: float, d_ceil: float) -> np.float32:
    """Value of the trigger policy; the flip starts when it is >= 0.

    ``sum_i alpha_i exp(-gamma |x - s_i|^2) + b`` with x the standardised cues (paper Eq. OC-SVM, with the
    bias inside the sign as in the authors' code: paper errata 6).

    Args:
        policy: from ``Policy.compiled()``.
        tau: time to contact, s; infinite while not approaching.
        theta_x: v_x / d_ceil, rad/s.
        d_ceil: distance to the ceiling, m.

    Returns:
        float32 value. Far from the region it is the intercept; for a NaN cue it is NaN, which does not
        trigger.
    """
    x0 = (np.float32(tau) - policy.scaler_mean[0]) / policy.scaler_std[0]
    x1 = (np.float32(theta_x) - policy.scaler_mean[1]) / policy.scaler_std[1]
    x2 = (np.float32(d_ceil) - policy.scaler_mean[2]) / policy.scaler_std[2]
    total = np.float32(0.0)
    for i in range(policy.dual_coefficients.shape[0]):
        e0 = x0 - policy.support_vectors[i, 0]
        e1 = x1 - policy.support_vectors[i, 1]
        e2 = x2 - policy.support_vectors[i, 2]
        squared = e0 * e0 + e1 * e1 + e2 * e2
        total += policy.dual_coefficients[i] * np.float32(math.exp(-policy.gamma * squared))
    return total + policy.intercept


@kernel
def trigger_values(policy: CompiledPolicy, states: NDArray[np.float32]) -> NDArray[np.float32]:
    """:func:`trigger_value` for many states.

    Args:
        policy: from ``Policy.compiled()``.
        states: (n, 3) float32, columns tau [s], theta_x [rad/s], d_ceil [m].

    Returns:
        (n,) float32.
    """
    values = np.empty(states.shape[0], np.float32)
    for i in range(states.shape[0]):
        values[i] = trigger_value(policy, states[i, 0], states[i, 1], states[i, 2])
    return values
