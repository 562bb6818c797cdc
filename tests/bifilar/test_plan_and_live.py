"""Planning a hang, and watching a swing while it is recorded."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from calibration.bench.inertia.errors import RigError
from calibration.bench.inertia.live import LiveState, LiveSwing, LiveView
from calibration.bench.inertia.plan import FORBIDDEN_RATIOS, PERIODS, Instruments, plan_hang
from calibration.bench.inertia.swing import CLOCK_WRAP_S, Swing
from tests.drawn_examples import examples
from tests.truth.bench.pendulum import Hang, record


@settings(max_examples=examples(40))
@given(st.floats(8e-6, 80e-6), st.floats(0.025, 0.06))
def test_a_plan_keeps_away_from_the_swing(inertia: float, mass: float) -> None:
    plan = plan_hang(inertia, mass)
    hang = Hang(inertia=inertia, mass=mass, top=plan.distance, bottom=plan.distance, length=plan.length)
    assert plan.period == pytest.approx(hang.period, rel=1e-9)
    swing_ratio = hang.period / (math.tau * math.sqrt(plan.length / hang.gravity))
    assert not any(low <= swing_ratio <= high for low, high in FORBIDDEN_RATIOS)
    assert PERIODS[0] <= plan.period <= PERIODS[1]
    assert plan.uncertainty < 0.004


def test_a_ruler_plans_for_a_larger_distance_and_expects_less() -> None:
    jig, ruler = plan_hang(16e-6, 0.034), plan_hang(16e-6, 0.034, Instruments(distance=0.5e-3))
    assert ruler.distance > jig.distance
    assert ruler.uncertainty > jig.uncertainty


@pytest.mark.parametrize(("inertia", "mass"), [(0.0, 0.03), (30e-6, -1.0), (30.0, 0.034), (math.nan, 0.03)])
def test_what_cannot_be_planned(inertia: float, mass: float) -> None:
    with pytest.raises(RigError, match="kg"):
        plan_hang(inertia, mass)


def feed(live: LiveSwing, swing: Swing, at: float) -> list[LiveView]:
    """Views after each sample of `swing`, begun at `at` (s)."""
    x = swing.time - swing.time[0] + at
    return [
        live.add(float(t), tuple(float(part) for part in row)) for t, row in zip(x, swing.gyro, strict=True)
    ]


def rest(seconds: float) -> Swing:
    time = 0.01 * np.arange(round(100 * seconds))
    gyro = np.array([0.01, -0.02, 0.005]) + np.random.default_rng(0).normal(0.0, 2.5e-3, (len(time), 3))
    return Swing(time, gyro, "rest")


HANG = Hang(top=0.08, bottom=0.08)


def test_rest_release_swing_enough() -> None:
    live = LiveSwing()
    still = feed(live, rest(5.0), 0.0)
    assert still[0].state is LiveState.STARTING
    assert still[-1].state is LiveState.STILL
    assert still[-1].rate < 0.02
    views = feed(live, record(HANG, np.random.default_rng(1), 10.0, cycles=24.0), 5.0)
    moving = [view for view in views if view.period is not None]
    assert moving[0].state is LiveState.MOVING
    for view in moving:
        assert view.period == pytest.approx(HANG.period, rel=0.02)
        assert view.in_band
    assert moving[0].amplitude == pytest.approx(math.radians(10.0), rel=0.06)
    states = [view.state for view in views]
    assert states.index(LiveState.ENOUGH) / len(states) == pytest.approx(20.0 / 24.0, abs=0.04)
    assert set(states[states.index(LiveState.ENOUGH) :]) == {LiveState.ENOUGH}
    assert views[-1].cycles == pytest.approx(24.0, abs=0.7)
    assert views[-1].swing_share is not None
    assert views[-1].swing_share < 0.01


def test_the_swing_share_is_shown() -> None:
    live = LiveSwing()
    views = feed(live, record(HANG.changed(swing=0.1), np.random.default_rng(2), 10.0), 0.0)
    assert views[-1].swing_share == pytest.approx(0.1, abs=0.03)


def test_small_swings_are_enough_before_they_are_useless() -> None:
    live = LiveSwing()
    views = feed(live, record(HANG.changed(linear=0.12), np.random.default_rng(3), 6.0, cycles=14.0), 0.0)
    assert views[-1].state is LiveState.ENOUGH
    assert views[-1].cycles < 16.0


def test_large_swings_are_out_of_the_band() -> None:
    live = LiveSwing()
    views = feed(live, record(HANG, np.random.default_rng(4), 30.0, cycles=6.0), 0.0)
    assert views[-1].amplitude > math.radians(20.0)
    assert not views[-1].in_band


def test_a_wrapping_clock_late_samples_and_a_hole() -> None:
    live = LiveSwing()
    swing = record(HANG, np.random.default_rng(5), 10.0, cycles=10.0)
    x = np.mod(swing.time - swing.time[0] + CLOCK_WRAP_S - 5.0, CLOCK_WRAP_S)
    for t, row in zip(x, swing.gyro, strict=True):
        live.add(float(t), tuple(float(part) for part in row))
        live.add(float(t) - 0.001, (100.0, 100.0, 100.0))
    assert len(swing) - 50 < live.view.samples <= len(swing)
    assert live.view.cycles == pytest.approx(10.0, abs=0.7)
    after = feed(live, rest(4.0), 100.0)
    assert after[-1].state is LiveState.STILL
    assert after[-1].cycles == 0.0


@settings(max_examples=examples(15))
@given(st.lists(st.tuples(st.floats(0, 1e5), st.floats(-40, 40)), max_size=400), st.floats(0.0, 1.0))
def test_any_samples_are_survived(samples: list[tuple[float, float]], scale: float) -> None:
    live = LiveSwing()
    for k, (t, rate) in enumerate(samples):
        view = live.add(t if scale < 0.2 else 0.02 * k, (rate, scale * rate, 0.0))
        assert math.isfinite(view.amplitude)
        assert math.isfinite(view.cycles)
