"""Every failure of a recording has its own finding, and a good recording has none."""

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from calibration.bench.inertia.checks import check_fit
from calibration.bench.inertia.errors import UnusableSwingError
from calibration.bench.inertia.fit import fit_swing
from calibration.bench.inertia.rest import check_rest
from calibration.bench.inertia.swing import CLOCK_WRAP_S, Swing
from calibration.measurement import Severity
from tests.truth.bench.pendulum import Hang, record, true_rate

HANG = Hang(top=0.08, bottom=0.08)


def good(seed: int = 0, **settings: float) -> Swing:
    return record(HANG, np.random.default_rng(seed), **settings)


def severities(swing: Swing) -> dict[str, Severity]:
    found = fit_swing(swing).findings
    assert all(finding.text.startswith(swing.source + ": ") for finding in found)
    return {finding.code: finding.severity for finding in found}


@pytest.mark.parametrize("seed", range(4))
def test_a_good_recording_has_no_finding(seed: int) -> None:
    assert severities(good(seed, degrees=6.0 + seed)) == {}


def _short(cycles: float) -> Swing:
    return good(cycles=cycles)


def _clipped(swing: Swing, share: float) -> Swing:
    limit = share * float(np.max(np.abs(swing.gyro[:, 2])))
    return replace(swing, gyro=np.clip(swing.gyro, -limit, limit))


def _beating() -> Swing:
    swing = good()
    t = swing.time - swing.time[0]
    near = 0.35 * np.cos(math.tau * 1.03 / HANG.period * t)
    gyro = swing.gyro.copy()
    gyro[:, 2] += near
    return replace(swing, gyro=gyro)


def _cross() -> Swing:
    swing = good()
    gyro = swing.gyro.copy()
    gyro[:, 0] += 0.2 * np.sin(math.tau * 0.4 * swing.time)
    return replace(swing, gyro=gyro)


def _pushed() -> Swing:
    swing = good()
    late = swing.time > swing.time[0] + 8.2 * HANG.period
    return replace(swing, gyro=swing.gyro * (1.0 + 0.6 * late[:, None]))


def _noisy() -> Swing:
    return good(noise=0.08)


def _backwards(rows: int) -> Swing:
    swing = good()
    time = swing.time.copy()
    time[100 : 100 + rows] -= 1.0
    return replace(swing, time=time)


WARNING, REJECT, NOTE = Severity.WARNING, Severity.REJECT, Severity.NOTE
FAILURES: list[tuple[str, Severity, Callable[[], Swing]]] = [
    ("few_cycles", REJECT, lambda: _short(6.0)),
    ("few_cycles", WARNING, lambda: _short(12.0)),
    ("large_amplitude", WARNING, lambda: good(degrees=24.0)),
    ("small_amplitude", REJECT, lambda: good(degrees=1.5)),
    ("gap", WARNING, lambda: good(gap=0.5)),
    ("loss", WARNING, lambda: good(loss=0.10)),
    ("loss", REJECT, lambda: good(loss=0.35)),
    ("host_time", WARNING, lambda: good(jitter=0.004)),
    (
        "clock_wrap",
        NOTE,
        lambda: replace(good(), time=np.mod(good().time + CLOCK_WRAP_S - 20.0, CLOCK_WRAP_S)),
    ),
    ("time_not_monotone", WARNING, lambda: _backwards(5)),
    ("time_not_monotone", REJECT, lambda: _backwards(200)),
    ("clipping", REJECT, lambda: _clipped(good(), 0.9)),
    ("clipping", REJECT, lambda: replace(good(), gyro=good().gyro * (34.5 / np.max(np.abs(good().gyro))))),
    ("swing", WARNING, lambda: record(HANG.changed(swing=0.06), np.random.default_rng(0))),
    ("swing", REJECT, lambda: record(HANG.changed(swing=0.2), np.random.default_rng(0))),
    ("beating", WARNING, _beating),
    ("beating", WARNING, _pushed),
    ("cross_axis", WARNING, _cross),
    ("wrong_axis", REJECT, lambda: good().about((1.0, 0.0, 0.0))),
    (
        "damping_high",
        WARNING,
        lambda: record(HANG.changed(linear=0.25), np.random.default_rng(0), 18.0, 12.0),
    ),
    (
        "damping_low",
        WARNING,
        lambda: record(HANG.changed(linear=0.0, quadratic=0.0), np.random.default_rng(0)),
    ),
    ("residual", WARNING, _noisy),
]


@pytest.mark.parametrize(("code", "severity", "make"), FAILURES)
def test_a_failure_has_its_own_finding(code: str, severity: Severity, make: Callable[[], Swing]) -> None:
    assert severities(make())[code] is severity


def test_estimators_that_disagree_are_named() -> None:
    swing = good()
    fit = fit_swing(swing)
    assert fit.crossing_period is not None
    for change, codes in ((1.002, []), (1.004, ["estimators_disagree"]), (0.5, ["estimators_disagree"])):
        other = replace(fit, crossing_period=fit.crossing_period * change)
        assert [finding.code for finding in check_fit(swing, other)] == codes


def test_a_wrapped_clock_changes_nothing_else() -> None:
    swing = good()
    wrapped = replace(swing, time=np.mod(swing.time + CLOCK_WRAP_S - 20.0, CLOCK_WRAP_S))
    assert fit_swing(wrapped).period.value == pytest.approx(fit_swing(swing).period.value, rel=1e-9)


@pytest.mark.parametrize(
    ("time", "gyro"),
    [
        (np.zeros(0), np.zeros((0, 3))),
        (np.arange(10.0), np.ones((10, 3))),
        (0.01 * np.arange(500), np.zeros((500, 3))),
        (np.zeros(500), np.ones((500, 3))),
        (0.01 * np.arange(500), np.linspace(0.0, 1.0, 1500).reshape(500, 3)),
    ],
)
def test_nothing_to_fit_is_refused_with_a_word_of_advice(time: np.ndarray, gyro: np.ndarray) -> None:
    with pytest.raises(UnusableSwingError, match=r"^empty: .*(record|log|release)"):
        fit_swing(Swing(time, gyro, "empty"))


def test_values_that_are_no_numbers_are_named() -> None:
    gyro = np.zeros((50, 3))
    gyro[17, 1] = np.nan
    with pytest.raises(UnusableSwingError, match="gyro of sample 17 is not finite"):
        Swing(0.01 * np.arange(50), gyro, "x")
    with pytest.raises(UnusableSwingError, match="shape"):
        Swing(0.01 * np.arange(49), gyro, "x")
    with pytest.raises(UnusableSwingError, match="axis"):
        Swing(np.zeros(0), np.zeros((0, 3)), "x", axis=(0.0, 0.0, 0.0))


def still(rng: np.random.Generator, axis: tuple[float, float, float] = (0.0, 0.0, 1.0)) -> Swing:
    time = 0.01 * np.arange(1000)
    gyro = np.array([0.01, -0.02, 0.03]) + rng.normal(0.0, 2.5e-3, (1000, 3))
    up = np.array([0.0, math.sin(math.radians(2.0)), math.cos(math.radians(2.0))])
    return Swing(time, gyro, "rest", 9.8 * up + rng.normal(0.0, 0.05, (1000, 3)), axis=axis)


def test_a_drone_at_rest() -> None:
    rest = check_rest(still(np.random.default_rng(0)))
    assert rest.findings == ()
    assert np.allclose(rest.bias, (0.01, -0.02, 0.03), atol=3e-4)
    assert rest.noise == pytest.approx(2.5e-3, rel=0.05)
    assert rest.tilt == pytest.approx(math.radians(2.0), abs=math.radians(0.1))


def test_a_drone_that_is_not_at_rest() -> None:
    swing = still(np.random.default_rng(1))
    slope = swing.gyro + 0.03 * swing.time[:, None] / swing.time[-1]
    moving = swing.gyro.copy()
    moving[:, 2] += true_rate(HANG, 1.0, swing.time)
    for changed, code in (
        (replace(swing, gyro=slope), "drift"),
        (replace(swing, gyro=moving), "moving"),
        (swing.about((0.0, 0.2, 1.0)), "tilt"),
        (swing.between(0.0, 2.0), "short_rest"),
    ):
        assert code in {finding.code for finding in check_rest(changed).findings}, code
    with pytest.raises(UnusableSwingError, match="wait"):
        check_rest(swing.between(0.0, 0.2))
