"""The second tier: what two clocks, a radio and hand-drawn marker frames do to a log."""

import numpy as np
from scipy.signal import lfilter

from tests.truth.hidden_effects.flight import HiddenFlight
from tests.truth.hidden_effects.layout import CONTROL_PERIOD
from tests.truth.hidden_effects.log_file import SAMPLE_PERIOD
from tests.truth.hidden_effects.sensors import blur, seen_pose

LAG_SD, WANDER_SD, WANDER_TIME = 0.020, (0.010, 0.015), 5.0
"""s: the motion capture's clock against the drone's, per flight and within one."""
GAP_SHARE, GAP_LENGTH = 0.05, (0.06, 0.30)
"""Share of the time without radio; s."""
BATTERY_PERIOD = 0.1
"""s between two voltages in the log."""
POSE, ONBOARD, VOLTAGE = slice(0, 7), slice(7, 18), 17


def with_defects(flight: HiddenFlight, seed: int, number: int, dead: bool) -> np.ndarray:
    """The flight's log (shape (m, 18)) as it would be read from a real recording.

    Args:
        flight: of `hidden_flight`.
        seed, number: as there.
        dead: the link is lost on the way, and the log goes on as a straight line.
    """
    rng = np.random.default_rng([seed, number, 4])
    log = flight.log.copy()
    log[:, POSE] = _poses_by_another_clock(flight, _clock_lag(len(log), rng), rng)
    log[:, VOLTAGE] = _interpolated(log[:, [VOLTAGE]], _every(len(log), BATTERY_PERIOD))[:, 0]
    heard = _heard(len(log), rng)
    log[:, ONBOARD] = _interpolated(log[:, ONBOARD], heard)
    if dead:
        lost = int(len(log) * rng.uniform(0.6, 0.8))
        slope = log[lost, ONBOARD] - log[lost - 1, ONBOARD]
        log[lost:, ONBOARD] = log[lost, ONBOARD] + np.arange(len(log) - lost)[:, None] * slope
    return log


def _clock_lag(samples: int, rng: np.random.Generator) -> np.ndarray:
    """Lag (s) of the logged pose behind the other channels, shape (samples,)."""
    keep = np.exp(-SAMPLE_PERIOD / WANDER_TIME)
    white = rng.standard_normal(samples) * np.sqrt(1.0 - keep * keep)
    white[0] = rng.standard_normal()
    return LAG_SD * rng.standard_normal() + rng.uniform(*WANDER_SD) * lfilter([1.0], [1.0, -keep], white)


def _poses_by_another_clock(flight: HiddenFlight, lag: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    p, out = flight.parameters, np.empty((len(lag), 7))
    ticks = (np.arange(len(lag)) * SAMPLE_PERIOD - p["pose_delay"] - lag) / CONTROL_PERIOD
    for row, tick in zip(out, np.clip(ticks, 0.0, len(flight.states) - 1.0), strict=True):
        seen_pose(p, flight.states, tick, row)
        blur(p, rng.standard_normal(6), row)
    return out


def _every(samples: int, period: float) -> np.ndarray:
    return np.arange(samples) % round(period / SAMPLE_PERIOD) == 0


def _heard(samples: int, rng: np.random.Generator) -> np.ndarray:
    """Which samples came through the radio, shape (samples,)."""
    heard = np.ones(samples, dtype=bool)
    while np.count_nonzero(~heard) < GAP_SHARE * samples:
        start = int(rng.integers(1, samples))
        heard[start : start + round(rng.uniform(*GAP_LENGTH) / SAMPLE_PERIOD)] = False
    return heard


def _interpolated(values: np.ndarray, known: np.ndarray) -> np.ndarray:
    """Straight lines between the rows that are known, shape as `values`."""
    at = np.arange(len(values))
    return np.column_stack([np.interp(at, at[known], column[known]) for column in values.T])
