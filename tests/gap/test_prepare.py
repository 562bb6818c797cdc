"""From flights to records: what is mended, masked, refused and said."""

import gzip
import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from calibration.flights import Flight, PoseSource, Trigger, flight_files, open_flights
from calibration.gap.data import prepare_flights
from tests.gap.measured_flight import (
    OFF,
    ON,
    changed,
    flight,
    reason_of,
    record_of,
    straightened,
    without,
)

ONBOARD = ("gx", "gy", "gz", "ax", "ay", "az", "m1", "m2", "m3", "m4")
MOTORS = ("m1", "m2", "m3", "m4")


def test_a_clean_flight_is_known_throughout() -> None:
    record = record_of(flight())
    assert record.motors_known.all()
    assert record.pose_known.all()
    assert record.inertial_known.all()
    assert record.notes == ()
    flying = record.t[record.flying]
    assert (flying[0], flying[-1]) == pytest.approx((ON + 1.0, OFF - 1.01), abs=0.011)  # 1 s at each end
    assert np.flatnonzero(np.diff(record.flying)).size == 2
    resting = record.t[record.resting]
    assert 1.5 < resting.size * record.dt < ON
    assert resting[-1] < ON - 0.2


def test_quaternions_become_unit_and_continuous() -> None:
    given = flight()
    rng = np.random.default_rng(3)
    scale = rng.choice([-1.0, 1.0], given.t.size) * rng.uniform(0.97, 1.03, given.t.size)
    parts = ("qx", "qy", "qz", "qw")
    record = record_of(changed(given, **{part: given.data[part] * scale for part in parts}))
    np.testing.assert_allclose(np.linalg.norm(record.attitude, axis=1), 1.0, atol=1e-12)
    assert np.sum(record.attitude[1:] * record.attitude[:-1], axis=1).min() > 0.99
    expected = np.column_stack([given.data[part] for part in parts])
    np.testing.assert_allclose(np.abs(np.sum(record.attitude * expected, axis=1)), 1.0, atol=1e-12)


def test_commands_beyond_full_scale_are_clipped() -> None:
    given = flight()
    motor = given.data["m2"].copy()
    motor[800], motor[900] = 90000.0, -40.0
    record = record_of(changed(given, m2=motor))
    assert (record.duty[800, 1], record.duty[900, 1]) == (1.0, 0.0)
    assert "2 motor commands beyond 0..65535 clipped" in record.notes


def test_radio_gaps_are_masked_and_short_ones_are_not() -> None:
    given = straightened(flight(), 800, 12, ONBOARD)
    given = straightened(given, 1000, 3, ONBOARD)  # 4 intervals
    record = record_of(given)
    lost = np.flatnonzero(~record.motors_known)
    assert (lost[0], lost[-1], lost.size) == (801, 812, 12)
    np.testing.assert_array_equal(record.inertial_known, record.motors_known)
    assert record.pose_known.all()
    assert record.flying[801:813].all()
    assert any("motor commands: 0.13 s lost" in note for note in record.notes)


def test_one_lost_block_does_not_spoil_the_others() -> None:
    record = record_of(straightened(flight(), 800, 12, MOTORS))
    assert not record.motors_known[805]
    assert record.inertial_known.all()


def test_a_dead_log_ends_the_flight() -> None:
    given = flight()
    columns = {}
    for name in ONBOARD:
        values = given.data[name].copy()
        values[1200:] = values[1200] + (np.arange(given.t.size - 1200) * (values[1200] - values[1199]))
        columns[name] = values
    record = record_of(changed(given, **columns))
    assert record.t[-1] == pytest.approx(12.0, abs=0.011)
    assert record.flying[-2]
    assert np.all(record.duty <= 1.0)
    assert any("motor commands: dead for the last 8.0 s" in note for note in record.notes)


@pytest.mark.parametrize("top", [0.05, 2.0])
def test_low_and_high_hovering_is_flight(top: float) -> None:
    record = record_of(replace(flight(top=top), ceiling_z=2.1))
    assert record.flying.sum() * record.dt > 12.0
    assert record.ceiling_z == 2.1


def test_nothing_counts_after_the_trigger_or_near_a_contact() -> None:
    record = record_of(replace(flight(), trigger=Trigger(10.0)))
    assert record.t[record.flying].max() == pytest.approx(9.99, abs=1e-6)
    touch = np.zeros(flight().t.size)
    touch[1000:1010] = 1.0
    record = record_of(changed(flight(), body_contact=touch))
    assert not record.flying[990:1020].any()
    assert record.flying[980]
    assert record.flying[1030]


def test_a_throttle_chop_is_part_of_the_flight() -> None:
    given = flight()
    chopped = {
        name: np.where(
            (given.t > 8.0) & (given.t < 8.3), 3000.0 + 9.0 * (given.t * 731 % 7), given.data[name]
        )
        for name in MOTORS
    }
    assert record_of(changed(given, **chopped)).flying[810:825].all()


def _jumps(given: Flight) -> Flight:
    return replace(given, t=given.t + np.where(given.t > 9.0, 500.0, 0.0))


def _stands(given: Flight) -> Flight:
    return replace(given, t=np.floor(given.t * 5.0) / 5.0)


def _milliseconds(given: Flight) -> Flight:
    return replace(given, t=given.t * 1e3)


def _late_motors(given: Flight) -> Flight:
    valid = dict(given.valid)
    for name in MOTORS:
        valid[name] = given.valid[name] & (np.arange(given.t.size) % 10 == 0)
    return replace(given, valid=valid)


def _in_range(given: Flight, full: float, zero: float = 0.0) -> Flight:
    return changed(given, **{name: zero + full / 65535.0 * given.data[name] for name in MOTORS})


def _on_the_floor(given: Flight) -> Flight:
    hop = 0.05 + 0.06 * np.abs(np.sin(3.0 * given.t)) * (given.t > ON)
    full = {name: np.where(given.data[name] > 0.0, 65535.0 - (given.data[name] % 97), 0.0) for name in MOTORS}
    return changed(given, z=hop, **full)


@pytest.mark.parametrize(
    ("spoil", "reason"),
    [
        (lambda f: without(f, "m3"), "no motor commands"),
        (lambda f: without(f, "gy"), "no gyro"),
        (lambda f: changed(f, z=np.full(f.t.size, np.nan)), "no pose"),
        (lambda f: changed(f, **dict.fromkeys(MOTORS, 0.0 * f.t)), "never flies: the motor commands are 0"),
        (lambda f: changed(f, **{m: f.data[m] * 0.1 for m in MOTORS}), "never flies: the motors hardly run"),
        (lambda f: _in_range(f, 1.0), "look like shares of full power (0 to 1); convert them to 0 to 65535"),
        (lambda f: _in_range(f, 100.0), "look like percent"),
        (lambda f: _in_range(f, 255.0), "look like bytes"),
        (lambda f: _in_range(f, 1000.0, 1000.0), "look like pulse widths"),
        (lambda f: changed(f, **dict.fromkeys(MOTORS, 30000.0 + 0.0 * f.t)), "log is a straight line"),
        (_on_the_floor, "stays on the floor with the motors running (highest"),
        (lambda f: replace(f, trigger=Trigger(ON + 1.5)), "s in free flight"),
        (_jumps, "broken clock: time jumps by 500.0 s at 9.000 s"),
        (_stands, "broken clock: 1900 of 2000 poses have the time of the one before"),
        (_milliseconds, "pose sampled every 10 s"),
        (_late_motors, "motor commands sampled every 0.1 s"),
    ],
)
def test_what_cannot_be_used_is_named(spoil: Callable[[Flight], Flight], reason: str) -> None:
    assert reason in reason_of(spoil(flight()))


def test_copies_are_found_by_their_numbers(tmp_path: Path) -> None:
    given = flight()
    names = ("x", "y", "z", "qx", "qy", "qz", "qw", "gx", "gy", "gz", "m1", "m2", "m3", "m4")
    rows = np.column_stack([given.t, *(given.data[name] for name in names)])
    text = "t," + ",".join(names) + "\n" + "\n".join(",".join(f"{v:.6f}" for v in row) for row in rows) + "\n"
    (tmp_path / "helix_rep1.csv").write_text(text)
    (tmp_path / "oval_rep9.csv.gz").write_bytes(gzip.compress(text.encode()))
    flights, _ = open_flights([tmp_path / "helix_rep1.csv", tmp_path / "oval_rep9.csv.gz"])
    prepared = prepare_flights([*flights, flight(seed=2)])
    assert [record.name for record in prepared.records] == ["helix_rep1", "circle_fast_rep1"]
    assert [refusal.file.name for refusal in prepared.refused] == ["oval_rep9.csv.gz"]
    assert "same numbers as" in prepared.refused[0].reason
    assert "helix_rep1.csv" in prepared.refused[0].reason


def test_kinds_come_from_what_was_flown_and_not_from_names() -> None:
    flights = [flight(f"flight_{i}", i) for i in range(3)]
    wide = changed(flight("flight_0", 9), x=3.0 * flight(seed=9).data["x"], y=3.0 * flight(seed=9).data["y"])
    kinds = [record.shape for record in prepare_flights([*flights, wide]).records]
    assert len(set(kinds[:3])) == 1
    assert kinds[3] not in kinds[:3]
    renamed = [replace(one, name=f"other_{i}") for i, one in enumerate([wide, *flights])]
    again = [record.shape for record in prepare_flights(renamed).records]
    assert again[0] not in again[1:]
    assert len(set(again[1:])) == 1


def test_limitations_say_what_cannot_be_concluded() -> None:
    flights = [flight("circle_rep1", 1), flight("helix_rep1", 2)]
    flights[1] = changed(flights[1], x=3.0 * flights[1].data["x"])
    assert prepare_flights(flights).limitations == ()
    assert "one single flight" in prepare_flights(flights[:1]).limitations[0]
    assert "no usable flight" in prepare_flights([]).limitations[0]
    bare = [without(f, "vbat", "ax", "ay", "az") for f in flights]
    text = " ".join(prepare_flights(bare).limitations)
    assert "no battery voltage" in text
    assert "no accelerometer" in text
    assert prepare_flights(bare).records[0].voltage is None
    some = prepare_flights([bare[0], flights[1]]).limitations
    assert any(line.endswith("(in circle_rep1)") for line in some)
    still = {**dict.fromkeys(("x", "y"), np.zeros(2000)), "gy": np.zeros(2000), "gz": np.zeros(2000)}
    quiet = [changed(f, **still, gx=np.random.default_rng(1).normal(0, 0.01, 2000)) for f in flights]
    quiet = [changed(f, x=f.data["x"] + 1e-3 * i) for i, f in enumerate(quiet)]
    assert any("hardly any excitation" in line for line in prepare_flights(quiet).limitations)
    estimate = [replace(f, pose_source=PoseSource.ONBOARD_ESTIMATE) for f in flights]
    assert any("sensing effects cannot be judged" in line for line in prepare_flights(estimate).limitations)


def test_what_readers_left_out_is_told_once_of_each_kind() -> None:
    notes = ("row 812 is cut off after 3 cells: left out", "row 94 is cut off after 11 cells: left out")
    flights = [replace(flight(f"circle_rep{i}", i), notes=(note,)) for i, note in enumerate(notes)]
    told = [line for line in prepare_flights(flights).limitations if "cut off" in line]
    assert told == [f"circle_rep0: {notes[0]} (and 1 more like it)"]


@pytest.mark.further
def test_public_flights(shared_data: Path) -> None:
    files = flight_files([shared_data / "nanobench"])
    assert len(files) == 20
    kinds = ("circle_fast", "circle_medium", "figure8_fast", "helix_rep1", "ramp", "oval")
    flights, unusable = open_flights([f for f in files if any(kind in f.name for kind in kinds)])
    assert not unusable
    prepared = prepare_flights(flights)
    assert len(prepared.records) == len(flights) - 2
    reasons = {refusal.file.name: refusal.reason for refusal in prepared.refused}
    assert reasons["B7_oval_slow_rep1.csv.gz"].startswith("never flies")
    assert reasons["B6_linear_ramp_rep1.csv.gz"].startswith("stays on the floor")
    records = {record.name: record for record in prepared.records}
    dead = records["B2_circle_medium_rep3"]
    assert any("dead for the last 11.0 s" in note for note in dead.notes)
    assert dead.duty.max() <= 1.0
    lost = sorted(float(np.mean(~r.motors_known[r.flying])) for r in prepared.records)
    assert lost[0] == 0.0
    assert 0.05 < lost[-1] < 0.15
    named = {(r.shape, re.sub(r"_(fast|medium|slow)?_?rep\d.*", "", r.name)) for r in prepared.records}
    assert {name for _, name in named} == {"B2_circle", "B3_figure8", "B5_helix", "B6_linear_ramp"}
    assert len({kind for kind, _ in named}) == len(named)  # told by what was flown: none holds two figures
    for record in prepared.records:
        assert record.resting.sum() * record.dt > 1.0
        assert 0.05 < np.median(record.position[record.resting, 2]) < 0.08
        assert np.all(record.position[record.flying, 2] > 0.08)


def test_the_authors_flights_lack_accelerometer_and_independent_pose(shared_data: Path) -> None:
    paths = flight_files([shared_data / "habas2022" / "flights"])[:6]
    prepared = prepare_flights(open_flights(paths)[0])
    assert prepared.records
    assert all(record.specific_force is None for record in prepared.records)
    assert any("no accelerometer" in line for line in prepared.limitations)
    assert any("onboard estimate" in line for line in prepared.limitations)
    for record in prepared.records:
        assert record.pose_source is PoseSource.ONBOARD_ESTIMATE
        assert record.ceiling_z is not None
        assert record.position[record.flying, 2].max() < record.ceiling_z
