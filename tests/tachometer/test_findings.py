"""Each fault gives its own finding, and clean data none."""

import dataclasses

import numpy as np
import pytest

from calibration.bench.motors.analysis import analyse
from calibration.bench.motors.checks import check_commands, check_edges, check_heat, check_speed
from calibration.bench.motors.errors import TachometerError
from calibration.bench.motors.mark_pattern import mark_pattern
from calibration.bench.motors.monitor import EdgeMonitor
from calibration.bench.motors.propellers import propeller
from calibration.bench.motors.records import CommandRecord, EdgeRecord
from calibration.bench.motors.revolutions import mark_passages, speed_trace
from calibration.bench.motors.steps import find_steps
from calibration.bench.procedures.motors import MotorPlan
from calibration.measurement import Severity
from onboard.vehicle import load_vehicle
from tests.truth.bench.rotor import Motor, Run, Sensor, edges, turn

PROPELLER = propeller("bitcraze-2015")


@pytest.fixture(scope="module")
def run() -> Run:
    return turn(Motor(), [0.0, 1500.0, 2400.0, 1500.0, 0.0])


def codes(record: EdgeRecord, marks: int, overflow: int = 0) -> dict[str, Severity]:
    parts = [mark_passages(part) for part in record.parts()]
    return {finding.code: finding.severity for finding in check_edges(record, parts, marks, overflow)}


@pytest.mark.parametrize(("true", "said"), [(2, 3), (3, 2), (4, 3), (3, 4)])
def test_wrong_number_of_blades_is_rejected(run: Run, true: int, said: int) -> None:
    for seed in range(5):
        record = edges(run, Sensor(marks=true, missed=0.003, doubled=0.001), np.random.default_rng(seed))
        assert codes(record, said)["blade_count"] is Severity.REJECT
        assert "blade_count" not in codes(record, true)


def test_wrong_blades_show_against_the_expected_speed() -> None:
    assert check_speed("x", 3600.0, 2400.0)[0].code == "blade_count"
    assert check_speed("x", 2500.0, 2400.0) == []
    assert check_speed("x", 3600.0, None)[0].code == "speed_range"


def test_a_motor_as_fast_as_its_file_says_is_no_wonder() -> None:
    plan = MotorPlan(load_vehicle("crazyflie21-upgraded"), PROPELLER)
    reach = plan.reach(3.7)
    assert reach is not None
    assert 3500.0 < reach < 3800.0
    assert check_speed("x", 3601.0, None, reach) == []
    assert "by the vehicle file up to" in check_speed("x", 4200.0, None, reach)[0].text
    assert check_speed("x", 2500.0, None, plan.reach(2.0)) == []
    assert check_speed("x", 3300.0, None, plan.reach(2.0))[0].code == "speed_range"


def test_bad_edges_are_counted(run: Run) -> None:
    rng = np.random.default_rng(0)
    assert "missed_edges" in codes(edges(run, Sensor(missed=0.04), rng), 2)
    assert "doubled_edges" in codes(edges(run, Sensor(doubled=0.04), rng), 2)
    assert codes(edges(run, Sensor(missed=0.003, doubled=0.001), rng), 2) == {}
    passages = mark_passages(edges(run, Sensor(missed=0.02, doubled=0.01), rng))
    assert passages.missed_share == pytest.approx(0.02, abs=0.004)
    assert passages.doubled_share == pytest.approx(0.01, abs=0.003)


def test_uneven_marks_cancel_and_are_said(run: Run) -> None:
    record = edges(run, Sensor(unevenness=0.3), np.random.default_rng(0))
    assert codes(record, 2)["uneven_marks"] is Severity.NOTE
    trace = speed_trace(mark_passages(record), 2, "x")
    steady = (trace.start > 4.2) & (trace.end < 4.7)
    assert np.std(trace.speed[steady]) < 4.0


def test_lamps_are_no_rotor() -> None:
    times = np.arange(0.0, 3.0, 0.01)
    assert codes(EdgeRecord(times, np.arange(times.size)), 2)["mains_flicker"] is Severity.REJECT


def test_reset_and_overflow(run: Run) -> None:
    record = edges(run, Sensor(), np.random.default_rng(0))
    half = record.times.size // 2
    times = np.concatenate([record.times[:half], record.times[half:] - record.times[half]])
    reset = dataclasses.replace(
        record, times=times, counts=np.concatenate([record.counts[:half], record.counts[half:] - half])
    )
    assert "clock_reset" in codes(reset, 2)
    assert "overflow" in codes(record, 2, overflow=3)


def test_swapped_directions_and_heat(run: Run) -> None:
    trace = speed_trace(mark_passages(edges(run, Sensor(), np.random.default_rng(0))), 2, "x")
    steps = find_steps(trace)
    assert [step.direction.value for step in steps] == ["up", "up", "down", "down"]
    assert check_commands(steps, run.commands) == []
    swapped = CommandRecord(run.commands.times, 60000.0 - run.commands.commands)
    assert check_commands(steps, swapped)[0].code == "directions_swapped"
    assert check_heat(trace) == []
    hot = turn(Motor(), [2400.0], hold=12.0)
    assert check_heat(speed_trace(mark_passages(edges(hot, Sensor(), np.random.default_rng(0))), 2, "x"))


def test_drift_short_steps_and_missing_direction() -> None:
    motion = turn(Motor(), [0.0, 1500.0, 2400.0])
    w = motion.w * (1.0 - 0.03 * np.maximum(motion.t - 3.4, 0.0))
    angle = np.concatenate([[0.0], np.cumsum(0.5 * (w[1:] + w[:-1]) * np.diff(motion.t))])
    record = edges(dataclasses.replace(motion, w=w, angle=angle), Sensor(), np.random.default_rng(0))
    seen = {finding.code for finding in analyse([record], PROPELLER, 0.09).findings}
    assert {"drifting", "no_steps", "few_steps", "clock_unchecked"} <= seen
    short = turn(Motor(), [0.0, 2400.0, 0.0], hold=0.3)
    seen = {
        f.code for f in analyse([edges(short, Sensor(), np.random.default_rng(0))], PROPELLER, 0.09).findings
    }
    assert "not_settled" in seen


def test_nothing_to_find_is_an_error() -> None:
    steady = turn(Motor(), [2000.0, 2000.0], w0=2000.0)
    with pytest.raises(TachometerError, match="no step was found"):
        analyse([edges(steady, Sensor(), np.random.default_rng(0))], PROPELLER, 0.09)
    with pytest.raises(TachometerError, match="thousands"):
        analyse([EdgeRecord(np.arange(5.0), np.arange(5))], PROPELLER, 0.09)


def test_pattern_of_marks_alike_says_nothing(run: Run) -> None:
    record = edges(run, Sensor(unevenness=0.0), np.random.default_rng(0))
    assert mark_pattern(mark_passages(record)).period is None


def test_monitor_follows_the_rotor(run: Run) -> None:
    record = edges(run, Sensor(missed=0.01), np.random.default_rng(0))
    monitor = EdgeMonitor(2)
    assert monitor.quality().edge_rate == 0.0
    part = record.times < 4.6
    monitor.add(record.times[part], record.counts[part])
    quality = monitor.quality()
    assert quality.speed == pytest.approx(2400.0, rel=2e-3)
    assert quality.edge_rate == pytest.approx(2400.0 / np.pi, rel=0.03)
    assert 1e-6 < quality.jitter < 8e-6
    assert 0.0 < quality.missed_share < 0.03
    monitor.tick(4.9)
    assert monitor.quality().speed == 0.0
    monitor.add(np.array([0.0, 0.001]), np.array([1, 2]))
    assert monitor.quality().edge_rate == 4.0


def test_a_rotor_that_settles_otherwise_than_the_law_does_not_drift() -> None:
    """First-order thrust, which the simulated bench has: coasting ends sooner than the law thinks."""
    levels = [0.0, 3600.0, 1277.0, 0.0, 2820.0, 1277.0, 0.0, 3600.0, 1870.0, 0.0]
    motion = turn(Motor(), levels)
    w = np.zeros_like(motion.w)
    for k, dt in enumerate(np.diff(motion.t)):
        level = levels[int(motion.t[k] // 1.6)]
        time = 0.0475 if level > w[k] else 0.136
        w[k + 1] = np.sqrt(level**2 + (w[k] ** 2 - level**2) * np.exp(-dt / time))
    angle = np.concatenate([[0.0], np.cumsum(0.5 * (w[1:] + w[:-1]) * np.diff(motion.t))])
    record = edges(dataclasses.replace(motion, w=w, angle=angle), Sensor(), np.random.default_rng(0))
    seen = {finding.code for finding in analyse([record], PROPELLER, 0.09).findings}
    assert "few_steps" in seen
    assert "drifting" not in seen
