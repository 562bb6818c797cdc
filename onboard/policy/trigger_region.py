"""The range of tau that a trigger policy's region covers.

The drone recognises a missed trigger by it: below ``tau_min`` the policy cannot fire any more.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from onboard.arrays import FloatArray
from onboard.policy.model import PolicyError

_FIRST_WIDTH = 0.5
"""Width of the first boxes, standard deviations; about the width of the kernel at the paper's gamma of 2."""

_CHUNK = 4096
"""Boxes judged at a time; bounds the memory for their distances to the support vectors."""

_MAX_BOXES = 2_000_000


@dataclass(frozen=True)
class _Trigger:
    """The trigger policy in standardised cues, double precision."""

    vectors: FloatArray
    duals: FloatArray
    gamma: float
    intercept: float

    def judge(self, centres: FloatArray, half_width: FloatArray) -> tuple[FloatArray, FloatArray]:
        """An upper bound of the trigger value over each box, and the value at its centre."""
        bounds = np.empty(len(centres))
        values = np.empty(len(centres))
        for start in range(0, len(centres), _CHUNK):
            chunk = slice(start, start + _CHUNK)
            distance = np.abs(centres[chunk, None, :] - self.vectors)
            nearest = np.maximum(distance - half_width, 0.0)
            bounds[chunk] = np.exp(-self.gamma * (nearest**2).sum(axis=2)) @ self.duals + self.intercept
            values[chunk] = np.exp(-self.gamma * (distance**2).sum(axis=2)) @ self.duals + self.intercept
        return bounds, values


def tau_range(
    *,
    scaler_mean: ArrayLike,
    scaler_std: ArrayLike,
    support_vectors: ArrayLike,
    dual_coefficients: ArrayLike,
    gamma: float,
    intercept: float,
    tolerance: float = 1.0e-4,
) -> tuple[float, float]:
    """Smallest and largest tau at which the trigger can fire, over all theta_x and all d_ceil > 0.

    Branch and bound over boxes in the standardised cues. In a box, no kernel exceeds its value at the box's
    point nearest to its support vector, so their sum bounds the trigger value from above: a box whose bound
    is negative is outside the region for certain. The result therefore encloses the region, by at most
    `tolerance` on each side.

    Args:
        scaler_mean: (3,).
        scaler_std: (3,).
        support_vectors: (n, 3), standardised.
        dual_coefficients: (n,), >= 0.
        gamma: of the kernel.
        intercept: < 0.
        tolerance: s.

    Returns:
        ``(tau_min, tau_max)``, s; tau_min is not below 0.

    Raises:
        PolicyError: the trigger fires nowhere, or its region is too intricate to bound.
    """
    mean = np.asarray(scaler_mean, np.float64)
    std = np.asarray(scaler_std, np.float64)
    vectors = np.asarray(support_vectors, np.float64)
    duals = np.asarray(dual_coefficients, np.float64)
    trigger = _Trigger(vectors, duals, float(gamma), float(intercept))
    total = float(duals.sum())
    if not total + intercept > 0:
        raise PolicyError("policy: the trigger fires nowhere: its coefficients do not add up to -intercept")
    # Farther than this from every support vector, the kernels cannot add up to -intercept.
    reach = math.sqrt(math.log(total / -intercept) / gamma)
    low = vectors.min(axis=0) - reach
    high = vectors.max(axis=0) + reach
    zero = -mean / std
    low[0] = max(low[0], zero[0])
    low[2] = max(low[2], zero[2])
    if np.any(low >= high):
        raise PolicyError(
            "policy: the trigger fires nowhere in flight: its region is at tau < 0 or d_ceil < 0"
        )
    smallest = _smallest_first_coordinate(trigger, low, high, tolerance / std[0])
    mirror = np.array([-1.0, 1.0, 1.0])
    mirrored = _Trigger(vectors * mirror, duals, trigger.gamma, trigger.intercept)
    mirrored_low = np.array([-high[0], low[1], low[2]])
    mirrored_high = np.array([-low[0], high[1], high[2]])
    largest = -_smallest_first_coordinate(mirrored, mirrored_low, mirrored_high, tolerance / std[0])
    return max(0.0, float(mean[0] + std[0] * smallest)), float(mean[0] + std[0] * largest)


def _smallest_first_coordinate(
    trigger: _Trigger, low: FloatArray, high: FloatArray, tolerance: float
) -> float:
    """A lower bound, tight to `tolerance`, of the first coordinate over the trigger's region within a box."""
    counts = np.ceil((high - low) / _FIRST_WIDTH).astype(int)
    half_width = (high - low) / counts / 2
    axes = [low[k] + half_width[k] * (2 * np.arange(counts[k]) + 1) for k in range(3)]
    centres = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    corners = np.stack(np.meshgrid(*[[-0.5, 0.5]] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
    best_inside = math.inf
    while True:
        bounds, values = trigger.judge(centres, half_width)
        inside = centres[values >= 0, 0]
        best_inside = min(best_inside, float(inside.min(initial=math.inf)))
        lower = centres[:, 0] - half_width[0]
        open_boxes = (bounds >= 0) & (lower < best_inside)
        if not open_boxes.any():
            if math.isinf(best_inside):
                raise PolicyError("policy: the trigger fires nowhere in flight; train it on more pairs")
            return best_inside
        lowest = float(lower[open_boxes].min())
        if best_inside - lowest <= tolerance:
            return lowest
        centres = centres[open_boxes]
        if len(centres) * len(corners) > _MAX_BOXES:
            raise PolicyError(
                "policy: the trigger's region is too intricate to bound its tau; check its gamma"
            )
        centres = (centres[:, None, :] + corners * half_width).reshape(-1, 3)
        half_width = half_width / 2
