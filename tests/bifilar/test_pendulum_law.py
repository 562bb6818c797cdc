"""The fit against a bifilar pendulum that was integrated from its own equation of motion."""

import math

import numpy as np
import pytest

from calibration.bench.inertia.fit import fit_swing
from calibration.bench.inertia.geometry import small_period
from calibration.bench.inertia.rig import Rig
from calibration.bench.inertia.swing_fit import SwingFit
from calibration.measurement import Estimate
from tests.truth.bench.pendulum import Hang, record


def rig(hang: Hang) -> Rig:
    top, bottom, length = (Estimate(value, "m", 0.0) for value in (hang.top, hang.bottom, hang.length))
    return Rig(Estimate(hang.mass, "kg", 0.0), top, bottom, length)


def inertia_error(fit: SwingFit, hang: Hang) -> float:
    """Relative."""
    return (small_period(fit, rig(hang)) / hang.period) ** 2 - 1.0


@pytest.mark.parametrize(("degrees", "limit"), [(5.0, 2e-4), (15.0, 2e-4), (25.0, 5e-4)])
@pytest.mark.parametrize("seed", range(3))
def test_losses_and_a_gap_leave_the_inertia_right(degrees: float, limit: float, seed: int) -> None:
    rng = np.random.default_rng([1, seed])
    hang = Hang(inertia=rng.uniform(15e-6, 50e-6), length=rng.uniform(0.5, 0.8))
    fit = fit_swing(record(hang, rng, degrees, loss=0.05, gap=0.4))
    assert abs(inertia_error(fit, hang)) < limit
    assert fit.start_amplitude == pytest.approx(math.radians(degrees), rel=0.02)
    assert fit.cycles == pytest.approx(20.0, abs=0.6)
    assert fit.loss == pytest.approx(0.06, abs=0.03)
    assert not fit.second_mode


def test_a_damped_sine_would_be_wrong_by_the_amplitude() -> None:
    hang = Hang()
    fit = fit_swing(record(hang, np.random.default_rng(2), 25.0))
    assert (fit.sine_period / hang.period) ** 2 - 1.0 > 0.01
    assert fit.crossing_period == pytest.approx(hang.period, rel=5e-4)


def test_arrival_times_with_jitter() -> None:
    hang = Hang(top=0.03, bottom=0.03, length=0.594)
    fit = fit_swing(record(hang, np.random.default_rng(3), 17.0, cycles=9.0, rate_hz=30.0, jitter=0.010))
    assert abs(inertia_error(fit, hang)) < 1e-3
    assert fit.loss is None
    assert "host_time" in {finding.code for finding in fit.findings}


def test_short_strings_far_apart_need_their_geometry() -> None:
    hang = Hang(top=0.1, bottom=0.1, length=0.4)
    fit = fit_swing(record(hang, np.random.default_rng(4), 20.0))
    without = (fit.period.value / hang.period) ** 2 - 1.0
    assert abs(without) > 1e-3
    assert abs(inertia_error(fit, hang)) < 2e-4


def test_strings_that_are_not_parallel() -> None:
    hang = Hang(top=0.09, bottom=0.05)
    fit = fit_swing(record(hang, np.random.default_rng(5), 8.0))
    assert abs(inertia_error(fit, hang)) < 2e-4


def test_a_long_recording_keeps_its_phase() -> None:
    hang = Hang(linear=0.002, quadratic=0.001)
    fit = fit_swing(record(hang, np.random.default_rng(6), 18.0, cycles=120.0, rate_hz=50.0))
    assert abs(inertia_error(fit, hang)) < 2e-4
    assert fit.residual_share < 0.02


@pytest.mark.parametrize("swing", [0.06, 0.10, 0.30])
def test_a_swing_is_seen_taken_out_and_rejected_when_large(swing: float) -> None:
    hang = Hang(top=0.08, bottom=0.08, swing=swing)
    fit = fit_swing(record(hang, np.random.default_rng(7), 10.0))
    severity = next(finding.severity.value for finding in fit.findings if finding.code == "swing")
    assert fit.second_mode
    assert fit.swing_frequency == pytest.approx(math.sqrt(hang.gravity / hang.length) / math.tau, rel=2e-3)
    assert fit.swing_share == pytest.approx(swing, rel=0.15)
    assert abs(inertia_error(fit, hang)) < 1e-3
    assert severity == ("reject" if fit.swing_share > 0.1 else "warning")


def test_a_turned_axis_is_the_one_that_is_found() -> None:
    axis = (0.3, -0.2, 0.93)
    fit = fit_swing(record(Hang(), np.random.default_rng(8), 10.0, axis=axis))
    assert np.allclose(fit.axis, np.array(axis) / np.linalg.norm(axis), atol=2e-3)
    assert fit.off_axis is not None
    assert fit.off_axis < 2e-3


def test_the_same_recording_gives_the_same_fit() -> None:
    recording = record(Hang(), np.random.default_rng(10), 12.0, loss=0.05)
    first, second = fit_swing(recording), fit_swing(recording)
    assert first.period == second.period
    assert np.array_equal(first.fitted, second.fitted)
