"""A policy small enough to read: it fires around one state and asks for one moment."""

import numpy as np

from onboard.policy.files import make_policy
from onboard.policy.model import ActionLayer, Policy


def small_policy(
    tau: float = 0.24, theta_x: float = 2.0, d_ceil: float = 0.5, a_rot: float = -5.5e-3
) -> Policy:
    """Fires within 0.02 s of `tau`, where theta_x and d_ceil are within 3 rad/s and 0.5 m."""
    hidden = ActionLayer(np.zeros((2, 3), np.float32), np.zeros(2, np.float32))
    output = ActionLayer(np.zeros((1, 2), np.float32), np.array([a_rot], np.float32))
    return make_policy(
        name="small",
        scaler_mean=[tau, theta_x, d_ceil],
        scaler_std=[0.015, 3.0, 0.5],
        support_vectors=[[0.0, 0.0, 0.0]],
        dual_coefficients=[1.0],
        gamma=0.7,
        intercept=-0.4,
        layers=(hidden, output),
        provenance={"made_by": "tests"},
    )
