"""Action policy: the feed-forward network that gives the flip's body moment, as the drone computes it.

Single precision throughout; ``docs/policy_bundle.md`` states the same arithmetic for a C implementation.
"""

import math

import numpy as np
from numpy.typing import NDArray

from onboard.jit import kernel, outlined
from onboard.policy.model import CompiledPolicy


@kernel
def action_moment(policy: CompiledPolicy, tau: float, theta_x: float, d_ceil: float) -> np.float32:
    """Body moment of the flip, ``a_rot``.

    A network on the standardised cues with ELU between the layers and a linear output (paper, section "Flip
    Action Policy"), limited to the policy's own range. The number of hidden layers is the policy's: two in
    the paper, three in the policy that flew (paper errata 7).

    Args:
        policy: from ``Policy.compiled()``.
        tau: time to contact, s.
        theta_x: v_x / d_ceil, rad/s.
        d_ceil: distance to the ceiling, m.

    Returns:
        float32 moment about b_y, N m, negative = nose up, within [a_rot_min, a_rot_max].
    """
    sizes = policy.layer_sizes
    widest = sizes[0]
    for size in sizes:
        widest = max(widest, size)
    values = np.empty(widest, np.float32)
    sums = np.empty(widest, np.float32)
    values[0] = (np.float32(tau) - policy.scaler_mean[0]) / policy.scaler_std[0]
    values[1] = (np.float32(theta_x) - policy.scaler_mean[1]) / policy.scaler_std[1]
    values[2] = (np.float32(d_ceil) - policy.scaler_mean[2]) / policy.scaler_std[2]
    layer_count = sizes.shape[0] - 1
    start = 0
    for layer in range(layer_count):
        inputs = sizes[layer]
        outputs = sizes[layer + 1]
        bias = start + outputs * inputs
        for row in range(outputs):
            total = policy.layer_numbers[bias + row]
            for column in range(inputs):
                total += policy.layer_numbers[start + row * inputs + column] * values[column]
            if layer < layer_count - 1 and total < np.float32(0.0):
                total = np.float32(math.expm1(total))
            sums[row] = total
        values, sums = sums, values
        start = bias + outputs
    moment = values[0]
    if not moment >= policy.a_rot_min:  # also when the cues were NaN: a flip command is never NaN
        return policy.a_rot_min
    if moment > policy.a_rot_max:
        return policy.a_rot_max
    return moment


@outlined
def action_moments(policy: CompiledPolicy, states: NDArray[np.float32]) -> NDArray[np.float32]:
    """:func:`action_moment` for many states.

    Args:
        policy: from ``Policy.compiled()``.
        states: (n, 3) float32, columns tau [s], theta_x [rad/s], d_ceil [m].

    Returns:
        (n,) float32 moments about b_y, N m.
    """
    moments = np.empty(states.shape[0], np.float32)
    for i in range(states.shape[0]):
        moments[i] = action_moment(policy, states[i, 0], states[i, 1], states[i, 2])
    return moments
