"""Optical-flow cues."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from onboard.cues import optical_flow_cues

speeds = st.floats(-10, 10)
heights = st.floats(0, 3)


def test_cues_of_a_known_approach():
    tau, theta_x, d_ceil = optical_flow_cues(1.579, 1.5, 2.0, 2.079)
    assert (tau, theta_x, d_ceil) == pytest.approx((0.25, 3.0, 0.5), rel=1e-6)


def test_flow_is_positive_forward():
    assert optical_flow_cues(1.0, 1.0, 1.0, 2.0)[1] > 0 > optical_flow_cues(1.0, -1.0, 1.0, 2.0)[1]


@given(z=heights, vx=speeds, vz=st.floats(-10, 0))
def test_tau_is_infinite_while_not_approaching(z, vx, vz):
    assert optical_flow_cues(z, vx, vz, 2.079)[0] == math.inf


@given(z=st.floats(0, 2.0), vx=speeds, vz=st.floats(0.01, 10))
def test_single_precision_and_consistent_below_the_ceiling(z, vx, vz):
    tau, theta_x, d_ceil = optical_flow_cues(z, vx, vz, 2.079)
    assert all(value == np.float32(value) for value in (tau, theta_x, d_ceil))
    assert d_ceil > 0
    assert tau > 0
    # x0 and z0 of constant-velocity motion come back from the cues.
    assert tau * vz == pytest.approx(2.079 - z, abs=1e-6)
    assert theta_x * d_ceil == pytest.approx(vx, abs=1e-5)


def test_at_and_above_the_ceiling_contact_is_now():
    assert optical_flow_cues(2.1, 1.0, 0.5, 2.1)[:2] == (0.0, math.inf)
    tau, theta_x, d_ceil = optical_flow_cues(2.2, -1.0, 0.5, 2.1)
    assert (tau, theta_x) == (0.0, -math.inf)
    assert d_ceil < 0
    assert optical_flow_cues(2.2, 0.0, 0.5, 2.1)[1] == 0.0


def test_a_missing_input_gives_no_number():
    assert math.isnan(optical_flow_cues(math.nan, 1.0, 1.0, 2.1)[0])
    assert math.isnan(optical_flow_cues(1.0, 1.0, math.nan, 2.1)[0])
    assert math.isnan(optical_flow_cues(1.0, math.nan, 1.0, 2.1)[1])
