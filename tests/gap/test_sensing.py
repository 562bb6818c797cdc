"""Sensing effects from the redundancy of motion capture and inertial sensors.

The flights here are kinematics: smooth motions whose derivatives are known, seen by sensors with noise. Where
they come from does not matter to this stage, which has no model of a vehicle. The flights of
``tests/truth/hidden_effects`` come on top.
"""

import itertools
import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from calibration.flights import PoseSource, flight_files, open_flights
from calibration.gap.data import differentiate, prepare_flights
from calibration.gap.data.record import FlightRecord
from calibration.gap.data.rotations import integrate_rate, products
from calibration.gap.data.smoothing import Smoothing
from calibration.gap.sensors import SensingFindings, apply_sensing, judge_sensing
from calibration.gap.sensors.first_path import first_path
from calibration.gap.sensors.pooling import pool
from onboard.arrays import FloatArray
from tests.truth.hidden_effects import make_flights

FINE = 1e-3
GRAVITY = np.array([0.0, 0.0, 9.81])


def seen(
    name: str,
    rng: np.random.Generator,
    *,
    delay: float = 0.0,
    wander: FloatArray | None = None,
    rotation: tuple[float, float, float] = (0.0, 0.0, 0.0),
    offset: tuple[float, float, float] = (0.0, 0.0, 0.0),
    bias: tuple[float, float, float] = (0.0, 0.0, 0.0),
    accelerometer: tuple[float, float, float] = (0.0, 0.0, 0.0),
    vigour: float = 1.0,
    seconds: float = 12.0,
) -> FlightRecord:
    """A motion of `seconds` s as sensors with these faults and ordinary noise see it, at 100 Hz.

    `wander`: further delay (s) of the pose, shape (samples,).
    """
    fine = np.arange(-0.2, seconds + 0.2, FINE)
    angles = vigour * waves(fine, rng, (0.25, 0.25, 0.5), ((0.4, 2.0), (0.4, 2.0), (0.1, 0.6)))
    position = vigour * waves(fine, rng, (0.5, 0.5, 0.2), ((0.2, 0.5), (0.2, 0.5), (0.2, 0.6)))
    attitude = Rotation.from_euler("xyz", angles)
    rate = (attitude[:-1].inv() * attitude[1:]).as_rotvec() / FINE
    acceleration = np.gradient(np.gradient(position, FINE, axis=0), FINE, axis=0)
    t = np.arange(0.0, seconds, 0.01)
    late = t - delay - (np.zeros(t.size) if wander is None else wander)
    at, pose = np.searchsorted(fine, t - 0.5 * FINE), np.searchsorted(fine, late - 0.5 * FINE)
    felt = attitude[at].inv().apply(acceleration[at] + GRAVITY) + accelerometer
    noise = Rotation.from_rotvec(rng.normal(0.0, 3e-3, (t.size, 3)))
    tracked = attitude[pose] * Rotation.from_rotvec(rotation) * noise
    where = position[pose] + attitude[pose].apply(offset) + rng.normal(0.0, 2e-4, (t.size, 3))
    all_of_it = np.ones(t.size, dtype=np.bool_)
    return FlightRecord(
        name=name,
        source=Path(f"{name}.csv"),
        shape=name,
        t=t,
        position=where + np.array([0.0, 0.0, 1.0]),
        velocity=differentiate(where, 0.01),
        attitude=tracked.as_quat(canonical=True),
        rate=0.5 * (rate[at] + rate[at - 1]) + bias + rng.normal(0.0, 0.01, (t.size, 3)),
        specific_force=felt + rng.normal(0.0, 0.05, (t.size, 3)),
        duty=np.full((t.size, 4), 0.5),
        voltage=None,
        flying=all_of_it,
        motors_known=all_of_it,
        pose_known=all_of_it,
        inertial_known=all_of_it,
        resting=~all_of_it,
    )


def waves(
    t: FloatArray, rng: np.random.Generator, sizes: tuple[float, ...], bands: tuple[tuple[float, float], ...]
) -> FloatArray:
    """Sums of three sines a column, frequencies (Hz) from `bands`."""
    columns = []
    for size, (low, high) in zip(sizes, bands, strict=True):
        parts = [np.sin(2 * np.pi * rng.uniform(low, high) * t + rng.uniform(0, 6.3)) for _ in range(3)]
        columns.append(size * np.mean(parts, axis=0) * 1.5)
    return np.column_stack(columns)


def campaign(seed: int, flights: int = 8, **faults: object) -> list[FlightRecord]:
    """Flights that share `faults` and have an accelerometer bias and a clock of their own."""
    rng = np.random.default_rng(seed)
    records = []
    for i in range(flights):
        own = tuple(rng.normal(0.0, 0.05, 3))
        records.append(seen(f"flight_{i}", rng, accelerometer=own, **faults))  # type: ignore[arg-type]
    return records


def names(findings: SensingFindings) -> list[str]:
    return [effect.name for effect in findings.effects]


@pytest.mark.further  # with the others: test_all_at_once
def test_delay_is_found_and_taken_out() -> None:
    records = campaign(1, delay=0.012)
    findings = judge_sensing(records)
    assert names(findings) == ["pose_delay"]
    (effect,) = findings.effects
    assert effect.parameters["delay"].value == pytest.approx(0.012, abs=3e-4)
    low, high = effect.parameters["delay"].ci95
    assert low < 0.012 < high
    assert effect.error_after < 0.8 * effect.error_before
    low, high = effect.improvement_ci95
    assert 0.0 < low < effect.error_before - effect.error_after < high < effect.error_before
    again = judge_sensing(apply_sensing(records, findings))
    assert names(again) == []
    assert abs(again.pooled["pose_delay"][0].mean) < 3e-4


@pytest.mark.parametrize("samples", [3, 8, 15])
def test_a_turn_that_begins_as_the_log_ends_is_no_wander_of_the_clock(samples: int) -> None:
    (record,) = campaign(3, flights=1)
    rate = record.rate.copy()
    rate[-samples:, 0] += np.linspace(0.0, 8.0, samples)
    path = first_path(replace(record, rate=rate, attitude=integrate_rate(rate, record.dt)))
    assert np.abs(path.delay).max() <= 0.02


def test_a_crash_does_not_ring_into_the_flight_before_it() -> None:
    (record,) = campaign(31, flights=1)
    crashed = (record.t >= 8.0)[:, None]
    tumbling = 40.0 * np.sin(record.t[:, None] * [31.0, 23.0, 17.0])
    fallen = replace(
        record,
        rate=np.where(crashed, tumbling, record.rate),
        attitude=integrate_rate(np.where(crashed, -tumbling, record.rate), record.dt),
        flying=record.flying & ~crashed[:, 0],
    )
    path = first_path(fallen)
    assert path.agreement > 0.9
    assert np.abs(path.delay).max() <= 0.02


@pytest.mark.further  # with the others: test_all_at_once
def test_rotation_is_found_about_all_axes_beside_accelerometer_biases() -> None:
    truth = (0.03, -0.02, 0.015)
    records = campaign(2, rotation=truth)
    findings = judge_sensing(records)
    assert names(findings) == ["pose_rotation"]
    effect = findings.effects[0]
    assert [effect.parameters[axis].value for axis in "xyz"] == pytest.approx(truth, abs=1.5e-3)
    assert names(judge_sensing(apply_sensing(records, findings))) == []


def test_a_bias_that_all_accelerometers_share_is_no_rotation() -> None:
    rng = np.random.default_rng(3)
    records = [seen(f"flight_{i}", rng, accelerometer=(0.3, -0.3, 0.0)) for i in range(8)]  # 1.8 deg at rest
    findings = judge_sensing(records)
    assert names(findings) == []
    for flight in findings.flights:
        assert flight.acceleration is not None
        assert flight.acceleration.bias == pytest.approx([0.3, -0.3, 0.0], abs=0.06)


@pytest.mark.further  # with the others: test_all_at_once
def test_offset_is_found() -> None:
    truth = (0.004, -0.008, 0.015)
    records = campaign(4, offset=truth)
    findings = judge_sensing(records)
    assert names(findings) == ["pose_offset"]
    assert [findings.effects[0].parameters[axis].value for axis in "xyz"] == pytest.approx(truth, abs=1e-3)
    corrected = apply_sensing(records, findings)[0]
    rng = np.random.default_rng(4)
    ideal = seen("flight_0", rng, accelerometer=tuple(rng.normal(0.0, 0.05, 3)))
    assert np.sqrt(np.mean((corrected.position - ideal.position) ** 2)) < 1e-3


@pytest.mark.further  # with the others: test_all_at_once
def test_gyro_bias_is_found() -> None:
    truth = (0.01, 0.0, -0.02)
    findings = judge_sensing(campaign(5, bias=truth))
    assert names(findings) == ["gyro_bias"]
    assert [findings.effects[0].parameters[axis].value for axis in "xyz"] == pytest.approx(truth, abs=5e-4)


def test_all_at_once() -> None:
    rotation, offset, bias = (0.02, 0.03, -0.02), (0.01, 0.0, 0.02), (0.02, -0.01, 0.01)
    findings = judge_sensing(campaign(6, delay=0.02, rotation=rotation, offset=offset, bias=bias))
    assert sorted(names(findings)) == ["gyro_bias", "pose_delay", "pose_offset", "pose_rotation"]
    found = {effect.name: [one.value for one in effect.parameters.values()] for effect in findings.effects}
    assert found["pose_delay"] == pytest.approx([0.02], abs=3e-4)
    assert found["pose_rotation"] == pytest.approx(rotation, abs=2e-3)
    assert found["pose_offset"] == pytest.approx(offset, abs=1.5e-3)
    assert found["gyro_bias"] == pytest.approx(bias, abs=1e-3)


@pytest.mark.parametrize(
    "seeds",
    [
        pytest.param(range(100, 103), marks=pytest.mark.further),
        pytest.param(range(103, 120), marks=pytest.mark.soak),
    ],
    ids=["few", "more"],
)
def test_nothing_is_claimed_of_good_sensors(seeds: range) -> None:
    for seed in seeds:
        findings = judge_sensing(campaign(seed, flights=5))
        assert names(findings) == [], seed
        assert findings.broken == ()


@pytest.mark.further
def test_what_flights_do_not_share_is_corrected_and_not_named() -> None:
    rng = np.random.default_rng(7)
    t = np.arange(0.0, 12.0, 0.01)
    records = []
    for i in range(10):
        wander = 0.01 * np.sin(2 * np.pi * t / rng.uniform(5.0, 9.0) + rng.uniform(0.0, 6.0))
        delay, turn = rng.normal(0.0, 0.02), tuple(rng.normal(0.0, 0.03, 3))
        records.append(seen(f"flight_{i}", rng, delay=delay, wander=wander, rotation=turn))
    findings = judge_sensing(records)
    assert names(findings) == []
    text = " ".join(findings.notes)
    assert "pose_delay differs from flight to flight" in text
    assert "pose_rotation differs from flight to flight" in text
    corrected = apply_sensing(records, findings)
    assert any("pose late by" in note for note in corrected[0].notes)
    again = judge_sensing(corrected)
    assert max(p.spread for p in again.pooled["pose_delay"]) < 1.5e-3
    assert max(p.spread for p in again.pooled["pose_rotation"]) < 3e-3
    assert max(np.ptp(f.attitude.path) for f in again.flights) < 8e-3  # of 20 ms


def test_a_pose_of_another_flight_is_a_broken_clock() -> None:
    records = campaign(8, flights=4)
    other = campaign(9, flights=1)[0]
    records[2] = replace(records[2], attitude=other.attitude, position=other.position)
    findings = judge_sensing(records)
    assert [broken.name for broken in findings.broken] == ["flight_2"]
    assert "agree at no delay" in findings.broken[0].reason
    assert [record.name for record in apply_sensing(records, findings)] == [
        "flight_0",
        "flight_1",
        "flight_3",
    ]


def test_flights_that_cannot_be_judged_stay_as_they_are() -> None:
    records = campaign(10, flights=3, delay=0.03)
    estimate = [replace(record, pose_source=PoseSource.ONBOARD_ESTIMATE) for record in records]
    findings = judge_sensing(estimate)
    assert findings.effects == ()
    assert findings.flights == ()
    assert apply_sensing(estimate, findings) == tuple(estimate)
    bare = judge_sensing([replace(record, specific_force=None) for record in records])
    assert "pose_offset" not in bare.pooled
    assert bare.pooled["pose_delay"][0].mean == pytest.approx(0.03, abs=5e-4)


def test_one_flight_names_nothing_and_is_still_corrected() -> None:
    records = campaign(11, flights=1, delay=0.03, bias=(0.05, 0.0, 0.0))
    findings = judge_sensing(records)
    assert findings.effects == ()
    corrected = apply_sensing(records, findings)[0]
    again = judge_sensing([corrected]).flights[0].attitude
    assert abs(again.delay) < 1e-3
    assert np.abs(again.bias).max() < 2e-3


def test_gaps_do_not_bias() -> None:
    records = []
    for record in campaign(12, delay=0.01):
        known = np.ones(record.t.size, dtype=np.bool_)
        rate = record.rate.copy()
        for start in (200, 430, 700, 1000):
            known[start : start + 20] = False
            rate[start : start + 20] = np.linspace(rate[start - 1], rate[start + 20], 20)
        records.append(replace(record, rate=rate, inertial_known=known))
    findings = judge_sensing(records)
    assert names(findings) == ["pose_delay"]
    assert findings.effects[0].parameters["delay"].value == pytest.approx(0.01, abs=5e-4)


def test_pooling_by_hand() -> None:
    same = pool(np.array([1.0, 1.0, 1.0]), np.array([0.1, 0.1, 0.1]))
    assert (same.mean, same.spread) == (1.0, 0.0)
    assert same.error == pytest.approx(0.1 / np.sqrt(3))
    assert not same.significant  # 17 standard errors, but of three flights
    wide = pool(np.array([-1.0, 0.0, 1.0, 2.0]), np.full(4, 1e-6))
    assert wide.mean == pytest.approx(0.5)
    assert wide.spread == pytest.approx(np.std([-1, 0, 1, 2], ddof=1), rel=1e-6)
    assert wide.error == pytest.approx(wide.spread / 2, rel=1e-6)
    assert wide.shrunk(2.0, 1e-6) == pytest.approx(2.0)
    assert wide.shrunk(2.0, 1e6) == pytest.approx(0.5)
    uneven = pool(np.array([0.0, 10.0]), np.array([1.0, 1e6]))
    assert uneven.mean == pytest.approx(0.0, abs=1e-6)


def test_both_smoothings_see_the_same_acceleration() -> None:
    rng = np.random.default_rng(13)
    acceleration = rng.normal(0.0, 3.0, (400, 3))  # linear between samples
    velocity = np.zeros_like(acceleration)
    velocity[1:] = np.cumsum(0.5 * (acceleration[1:] + acceleration[:-1]), axis=0) * 0.01
    position = np.zeros_like(velocity)
    step = velocity[:-1] * 0.01 + (acceleration[:-1] / 3 + acceleration[1:] / 6) * 1e-4
    position[1:] = np.cumsum(step, axis=0)
    smoothing = Smoothing(0.01)
    inner = slice(smoothing.half, -smoothing.half)
    np.testing.assert_allclose(
        smoothing.second_derivative(position)[inner], smoothing.mean(acceleration)[inner], atol=1e-8
    )


def test_the_integral_of_a_rate_is_the_product_of_its_steps() -> None:
    rate = np.random.default_rng(14).normal(0.0, 3.0, (300, 3))
    attitude = Rotation.identity()
    for before, after in itertools.pairwise(rate):
        attitude = attitude * Rotation.from_rotvec(0.005 * (before + after))
    result = integrate_rate(rate, 0.01)
    assert result.shape == (300, 4)
    assert (Rotation.from_quat(result[-1]).inv() * attitude).magnitude() < 1e-9
    a, b = result[5:9], result[20:24]
    expected = (Rotation.from_quat(a) * Rotation.from_quat(b)).as_matrix()
    np.testing.assert_allclose(Rotation.from_quat(products(a, b)).as_matrix(), expected, atol=1e-12)


@pytest.mark.parametrize(
    "case",
    [
        pytest.param("pose_delay", marks=pytest.mark.soak),
        pytest.param("gyro_bias", marks=pytest.mark.further),
        pytest.param("com_offset", marks=pytest.mark.soak),
        pytest.param("pose_rotation", marks=pytest.mark.soak),
        pytest.param("pose_offset", marks=pytest.mark.soak),
    ],
)
def test_hidden_effects(case: str, tmp_path: Path) -> None:
    answer = tmp_path / "answer.json"
    files = make_flights(case, "medium", 21, 7, out=tmp_path / "flights", answer=answer)
    findings = judge_sensing(prepare_flights(open_flights(files)[0]).records)
    expected = [] if case == "com_offset" else [case]  # that moves the sensors and the markers alike
    assert names(findings) == expected
    if expected:
        truth = json.loads(answer.read_text())["effects"][0]["parameters"]
        found = {key: one.value for key, one in findings.effects[0].parameters.items()}
        size = np.linalg.norm(list(truth.values()))
        assert np.linalg.norm([found[key] - truth[key] for key in truth]) < 0.1 * size


def test_public_flights(shared_data: Path) -> None:
    files = [f for f in flight_files([shared_data / "nanobench"]) if "circle" in f.name]
    records = prepare_flights(open_flights(files)[0]).records
    findings = judge_sensing(records)
    assert findings.broken == ()
    assert all(abs(flight.attitude.delay) < 0.09 for flight in findings.flights)
    assert max(flight.attitude.wander for flight in findings.flights) >= 0.01
    assert any("pose_delay differs from flight to flight" in note for note in findings.notes)
    # Markers sit above the board, in every flight; the gyro was calibrated at the start.
    assert names(findings) == ["pose_offset"]
    assert findings.pooled["pose_offset"][2].mean == pytest.approx(0.0155, abs=0.003)
