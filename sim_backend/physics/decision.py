"""What a policy decides at given cues: one compiled function for every kind of policy."""

from typing import Any, NamedTuple

import numpy as np
from numba.extending import overload

from onboard.policy.action import action_moment
from onboard.policy.model import CompiledPolicy
from onboard.policy.trigger import trigger_value


class ThresholdPolicy(NamedTuple):
    """The policy of one learning trial: flip with a_rot once tau <= tau_critical.

    Attributes:
        tau_critical: s.
        a_rot: N m about b_y, negative = nose up.
    """

    tau_critical: float
    a_rot: float


def decide(policy: Any, tau: float, theta_x: float, d_ceil: float) -> tuple[bool, float]:
    """Whether a policy flips at these cues, and the moment (N m); compiled once per kind of policy."""
    raise NotImplementedError("decide() exists in compiled code only")


@overload(decide, strict=False)
def _decide(policy: Any, tau: Any, theta_x: Any, d_ceil: Any) -> Any:
    kind = getattr(policy, "instance_class", None)
    if kind is ThresholdPolicy:
        return _threshold
    return _two_stage if kind is CompiledPolicy else None


def _threshold(policy: Any, tau: float, theta_x: float, d_ceil: float) -> tuple[bool, float]:
    return tau <= policy.tau_critical, policy.a_rot


def _two_stage(policy: Any, tau: float, theta_x: float, d_ceil: float) -> tuple[bool, float]:
    fires = bool(trigger_value(policy, tau, theta_x, d_ceil) >= np.float32(0.0))
    return fires, float(action_moment(policy, tau, theta_x, d_ceil)) if fires else 0.0
