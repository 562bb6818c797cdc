"""The whole analysis on a rotor that is integrated numerically, with a sensor that errs."""

import dataclasses

import numpy as np
import pytest

from calibration.bench.motors.analysis import analyse
from calibration.bench.motors.clock import ClockFit, fit_clock
from calibration.bench.motors.propellers import propeller
from calibration.bench.motors.settling import first_order_constant, time_to_share
from calibration.bench.motors.tachometer_result import TachometerResult
from calibration.measurement import Estimate
from onboard.json_file import as_json
from tests.truth.bench.rotor import Motor, Run, Sensor, edges, staircase, turn, windows

HOVER = 0.0934
PROPELLER = propeller("bitcraze-2015")
CLOCK = ClockFit(Estimate(1.0, "1", 5e-5), 60.0)
MOTOR = Motor()
STEPS_UP = ((300.0, 2400.0), (1500.0, 2400.0), (0.0, 1500.0), (2000.0, 2200.0))


def numeric_63(motor: Motor, start: float, end: float) -> float:
    """63 % time of thrust by small Euler steps."""
    goal = start**2 + (1.0 - np.exp(-1.0)) * (end**2 - start**2)
    w, t, dt = start, 0.0, 1e-6
    while (w**2 - goal) * (end - start) < 0.0:
        w += dt * motor.acceleration(w, end)
        t += dt
    return t


@pytest.fixture(scope="module")
def run() -> Run:
    return turn(MOTOR, staircase(np.random.default_rng(1), repeats=2))


def check_times(result: TachometerResult, relative: float, absolute: float, motor: Motor = MOTOR) -> None:
    assert result.up is not None
    assert result.down is not None
    for start, end in STEPS_UP:
        up = time_to_share(start, end, motor.a_up, motor.b_up)
        assert abs(result.up.time_63(start, end).value - up) < max(relative * up, absolute)
        down = time_to_share(end, start, motor.a_down, motor.b_down)
        assert abs(result.down.time_63(end, start).value - down) < max(relative * down, absolute)
    hover = PROPELLER.speed(HOVER)
    told = as_json(result)["hover"]
    tau = [told[name]["value"] for name in ("tau_up", "tau_down")]
    expected = [
        1.0 / (motor.a_up + 2.0 * motor.b_up * hover),
        1.0 / (motor.a_down + 2.0 * motor.b_down * hover),
    ]
    assert tau == pytest.approx(expected, rel=0.02)


def test_63_percent_times_by_small_steps() -> None:
    assert time_to_share(300.0, 2400.0, MOTOR.a_up, MOTOR.b_up) == pytest.approx(
        numeric_63(MOTOR, 300.0, 2400.0), abs=3e-6
    )
    assert time_to_share(2400.0, 0.0, MOTOR.a_down, MOTOR.b_down) == pytest.approx(
        numeric_63(MOTOR, 2400.0, 0.0), abs=3e-6
    )


def test_first_order_constant_of_a_first_order_response() -> None:
    # With small steps both are exponentials with the local constant.
    assert first_order_constant(2000.0, 2001.0, 2.0, 4e-3) == pytest.approx(
        1.0 / (2.0 + 8e-3 * 2000.5), rel=2e-3
    )


def test_clean_edges_give_times_within_a_thousandth(run: Run) -> None:
    result = analyse([edges(run, Sensor(), np.random.default_rng(2))], PROPELLER, HOVER, clock=CLOCK)
    check_times(result, 1e-3, 1e-4)
    assert result.accepted
    assert [f.code for f in result.findings] == []
    assert result.up is not None
    assert result.up.alternatives[0].name == "speed_law"


def test_missed_and_doubled_edges_cost_little(run: Run) -> None:
    sensor = Sensor(missed=0.02, doubled=0.01)
    result = analyse([edges(run, sensor, np.random.default_rng(3))], PROPELLER, HOVER, clock=CLOCK)
    check_times(result, 0.02, 0.0)


def test_window_averages_are_within_eight_percent_and_say_so() -> None:
    # As the authors' motors are: without a back electromotive force that shows.
    motor = Motor(a_up=0.0, b_up=4.24e-3)
    rng = np.random.default_rng(4)
    result = analyse([windows(turn(motor, staircase(rng)), 0.051, rng)], PROPELLER, HOVER)
    check_times(result, 0.08, 0.0, motor)
    assert result.up is not None
    assert result.up.time_63(0.0, 2400.0).u95 > 0.078 * result.up.time_63(0.0, 2400.0).value
    assert "low_resolution" in {finding.code for finding in result.findings}


def test_a_clock_that_is_off_is_corrected(run: Run) -> None:
    rng = np.random.default_rng(5)
    off = 1.005
    host = np.arange(0.0, 60.0, 0.1)
    late = host + 2e-3 + rng.exponential(3e-3, host.size) + (rng.random(host.size) < 0.02) * 0.3
    clock = fit_clock(host * off + 17.0, late)
    assert clock.scale.value * off == pytest.approx(1.0, abs=2e-4)
    record = edges(run, Sensor(), rng, clock=off)
    check_times(analyse([record], PROPELLER, HOVER, clock=clock), 2e-3, 2e-4)


def test_lost_lines_are_known_and_used(run: Run) -> None:
    record = edges(run, Sensor(), np.random.default_rng(6))
    lines = np.arange(record.times.size) // 8
    kept = ~np.isin(lines, np.random.default_rng(7).choice(lines.max(), 30, replace=False))
    lossy = dataclasses.replace(record, times=record.times[kept], counts=record.counts[kept])
    result = analyse([lossy], PROPELLER, HOVER, clock=CLOCK)
    check_times(result, 5e-3, 2e-4)
    assert any(f"{240} of" in finding.text for finding in result.findings if finding.code == "lost_edges")


@pytest.mark.soak
def test_intervals_cover_the_truth() -> None:
    held = []
    for seed in range(4):
        rng = np.random.default_rng(100 + seed)
        motor = Motor(
            rng.uniform(1.0, 4.0),
            rng.uniform(3.5e-3, 5e-3),
            rng.uniform(0.2, 0.8),
            rng.uniform(1.5e-3, 2.2e-3),
        )
        record = edges(
            turn(motor, staircase(rng, repeats=2)), Sensor(), rng, clock=1.0 + rng.normal(0.0, 5e-5)
        )
        result = analyse([record], PROPELLER, HOVER, clock=CLOCK)
        assert result.down is not None
        low, high = result.down.time_63(2400.0, 300.0).interval
        held.append(low < time_to_share(2400.0, 300.0, motor.a_down, motor.b_down) < high)
    assert sum(held) >= 3
