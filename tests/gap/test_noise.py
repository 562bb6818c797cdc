"""Coloured noise is whitened by the past alone."""

import numpy as np
import pytest

from calibration.gap.estimate.noise import fit_autoregression, whiten, whole_windows


def coloured(rng: np.random.Generator, count: int) -> np.ndarray:
    noise, values = rng.normal(size=count), np.zeros(count)
    for k in range(2, count):
        values[k] = 1.5 * values[k - 1] - 0.7 * values[k - 2] + noise[k]
    return values[:, None]


def test_a_second_order_process_is_found_and_whitened() -> None:
    signal = coloured(np.random.default_rng(1), 40_000)
    whole = whole_windows(np.ones((40_000, 1), dtype=bool), np.array([0, 40_000]), 6)
    coefficients = fit_autoregression(signal, whole, 6)
    assert coefficients[0, :2] == pytest.approx([1.5, -0.7], abs=0.02)
    assert coefficients[0, 2:] == pytest.approx(0.0, abs=0.02)
    innovations = whiten(signal, whole, coefficients)[whole]
    assert innovations.std() == pytest.approx(1.0, rel=0.02)
    for lag in (1, 2, 5, 20):
        assert abs(np.mean(innovations[lag:] * innovations[:-lag])) < 0.02


def test_innovations_do_not_look_ahead() -> None:
    signal = coloured(np.random.default_rng(2), 500)
    whole = whole_windows(np.ones((500, 1), dtype=bool), np.array([0, 500]), 6)
    coefficients = fit_autoregression(signal, whole, 6)
    changed = signal.copy()
    changed[300:] += 7.0
    before, after = whiten(signal, whole, coefficients), whiten(changed, whole, coefficients)
    assert np.array_equal(before[:300], after[:300])
    assert before[300] != after[300]


def test_windows_do_not_reach_over_gaps_or_into_another_flight() -> None:
    valid = np.ones((60, 1), dtype=bool)
    valid[40] = False
    whole = whole_windows(valid, np.array([0, 25, 60]), 5)
    expected = [k for k in range(60) if 5 <= k < 25 or 30 <= k < 40 or k >= 46]
    assert np.flatnonzero(whole[:, 0]).tolist() == expected
