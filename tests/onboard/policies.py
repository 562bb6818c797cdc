"""Policies for tests: arbitrary valid ones, and the authors' flown one."""

import itertools

import numpy as np
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from onboard.policy.files import ActionLayer, Policy


def float32s(low: float, high: float, *, exclude_min: bool = False) -> st.SearchStrategy[float]:
    """Numbers that float32 holds exactly, within bounds rounded to float32."""
    bounds = float(np.float32(low)), float(np.float32(high))
    return st.floats(*bounds, width=32, exclude_min=exclude_min, allow_subnormal=False)


def matrices(shape: int | tuple[int, ...], limit: float) -> st.SearchStrategy[np.ndarray]:
    return arrays(np.float32, shape, elements=float32s(-limit, limit))


@st.composite
def policies(draw: st.DrawFn) -> Policy:
    """Any valid policy, with few support vectors to keep the search fast."""
    count = draw(st.integers(1, 6))
    widths = [3, *draw(st.lists(st.integers(1, 5), max_size=4)), 1]
    layers = tuple(
        ActionLayer(draw(matrices((after, before), 1e4)), draw(matrices(after, 1e4)))
        for before, after in itertools.pairwise(widths)
    )
    tau_min, tau_max = sorted(draw(st.lists(float32s(0, 10), min_size=2, max_size=2, unique=True)))
    a_rot_min, a_rot_max = sorted(draw(st.lists(float32s(-0.05, 0), min_size=2, max_size=2, unique=True)))
    return Policy(
        name=draw(st.text(max_size=20)),
        scaler_mean=draw(matrices(3, 1e3)),
        scaler_std=draw(arrays(np.float32, 3, elements=float32s(1e-6, 1e3))),
        support_vectors=draw(matrices((count, 3), 100)),
        dual_coefficients=draw(arrays(np.float32, count, elements=float32s(0, 1e3))),
        gamma=np.float32(draw(float32s(0, 1e3, exclude_min=True))),
        intercept=np.float32(-draw(float32s(0, 1e3, exclude_min=True))),
        tau_min=np.float32(tau_min),
        tau_max=np.float32(tau_max),
        layers=layers,
        a_rot_min=np.float32(a_rot_min),
        a_rot_max=np.float32(a_rot_max),
    )


def small_policy() -> Policy:
    """The policy of the example in ``docs/policy_bundle.md``."""
    return Policy(
        name="example",
        scaler_mean=np.array([0.25, 4.0, 0.5], np.float32),
        scaler_std=np.array([0.015625, 2.0, 0.25], np.float32),
        support_vectors=np.array([[0, 0, 0], [1, -0.5, 0.25]], np.float32),
        dual_coefficients=np.array([1.0, 0.5], np.float32),
        gamma=np.float32(2.0),
        intercept=np.float32(-1.0),
        tau_min=np.float32(0.2421875),
        tau_max=np.float32(0.2578125),
        layers=(
            ActionLayer(
                np.array([[0.5, -1, 0.25], [-0.25, 0.5, 1]], np.float32), np.array([0.125, -0.5], np.float32)
            ),
            ActionLayer(np.array([[-0.001, 0.002]], np.float32), np.array([-0.0065], np.float32)),
        ),
        a_rot_min=np.float32(-0.0095),
        a_rot_max=np.float32(0.0),
    )
