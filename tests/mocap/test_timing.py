import math

import numpy as np
import pytest

from mocap_bridge.timing import CaptureClock, credible_latency

PERIOD = 0.01


def run(seconds: float, jitter: float, first_frame: int = 0, start: float = 100.0, drift: float = 0.0):
    """Frames of known exposure, sent 4 ms later, delayed on the network by up to `jitter`, in order."""
    rng = np.random.default_rng(8)
    last = -math.inf
    for i in range(int(seconds / PERIOD)):
        exposure = start + i * PERIOD * (1.0 + drift)
        last = max(last + 1e-6, exposure + 0.004 + jitter * rng.random())
        yield exposure, last, (first_frame + i) * PERIOD


@pytest.mark.parametrize(("drift", "p95"), [(0.0, 0.5e-3), (50e-6, 1e-3), (-50e-6, 1e-3)])
def test_capture_time_under_jitter_of_20_ms(drift: float, p95: float):
    clock = CaptureClock()
    errors = [
        clock.capture_time(receipt, source_time, PERIOD, 0.004) - exposure
        for exposure, receipt, source_time in run(20.0, 0.020, drift=drift)
    ]
    settled = np.abs(errors[500:])
    assert np.percentile(settled, 95) <= p95
    assert abs(np.mean(errors[500:])) <= 1e-3


def test_capture_is_never_later_than_the_frame_itself_allows():
    clock = CaptureClock()
    for _, receipt, source_time in run(3.0, 0.02):
        assert clock.capture_time(receipt, source_time, PERIOD, 0.004) <= receipt - 0.004 + 1e-9


def test_a_counter_that_starts_again_is_locked_at_once():
    clock = CaptureClock()
    for _, receipt, source_time in run(6.0, 0.0, first_frame=5000):
        clock.capture_time(receipt, source_time, PERIOD, 0.004)
    for exposure, receipt, source_time in run(1.0, 0.0, first_frame=0, start=200.0):
        assert clock.capture_time(receipt, source_time, PERIOD, 0.004) == pytest.approx(exposure, abs=1e-6)


@pytest.mark.parametrize("pause", [0.2, 3.0])
def test_a_counter_that_stood_still_is_locked_within_a_second(pause: float):
    clock = CaptureClock()
    for _, receipt, source_time in run(6.0, 0.0):
        clock.capture_time(receipt, source_time, PERIOD, 0.004)
    errors = [
        clock.capture_time(receipt, source_time, PERIOD, 0.004) - exposure
        for exposure, receipt, source_time in run(2.0, 0.0, first_frame=600, start=106.0 + pause)
    ]
    assert max(np.abs(errors[102:])) < 1e-6


def test_a_new_frame_rate_is_locked_at_once():
    clock = CaptureClock()
    for _, receipt, source_time in run(6.0, 0.0):
        clock.capture_time(receipt, source_time, PERIOD, 0.004)
    assert clock.capture_time(106.0, 5000 * 0.005, 0.005, 0.004) == pytest.approx(105.996)


def test_without_a_period_the_receipt_minus_latency_and_delay_is_all_there_is():
    assert CaptureClock().capture_time(10.0, None, None, 0.003, 0.001) == pytest.approx(9.996)


@pytest.mark.parametrize("latency", [1.8e35, -0.001, 0.1001, math.nan, math.inf, None])
def test_latency_that_cannot_be_true_is_not_believed(latency: float | None):
    assert credible_latency(latency) is None


@pytest.mark.parametrize("latency", [0.0, 0.0034, 0.1])
def test_latency_that_can_be_true_is_believed(latency: float):
    assert credible_latency(latency) == latency
