"""From the channels of a flight, whatever their rates and clocks, to one grid."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from calibration.flights import open_flight
from calibration.flights.flight import finite_masks
from calibration.gap.data import differentiate
from perchhw.record import RunRecorder
from tests.gap.measured_flight import flight, record_of

MOTORS = ("m1", "m2", "m3", "m4")


def test_dropped_frames_and_other_rates_end_on_one_grid() -> None:
    given = flight()
    keep = np.ones(given.t.size, dtype=np.bool_)
    keep[[700, 1100, 1101, 1102, 1103, 1104]] = False
    data = {name: values[keep] for name, values in given.data.items()}
    record = record_of(replace(given, t=given.t[keep], data=data, valid=finite_masks(data)))
    assert np.ptp(np.diff(record.t)) < 1e-9
    assert record.pose_known[700]
    assert not record.pose_known[1102]
    known = record.pose_known
    assert np.count_nonzero(~known) == 5
    np.testing.assert_allclose(record.position[known, 0], given.data["x"][known], atol=2e-5)


def test_quick_channels_are_averaged_and_slow_ones_interpolated() -> None:
    given = flight()
    t = np.arange(20 * 1000) * 1e-3
    data = {name: np.full(t.size, np.nan) for name in given.data}
    for name, values in given.data.items():
        every = 20 if name in MOTORS else 10
        data[name][::every] = np.interp(t[::every], given.t, values)
    wave = 0.4 * np.sin(2 * np.pi * 100.0 * t + 0.3)  # vibration at the rate of the grid would alias
    for name in ("gx", "gy", "gz"):
        data[name] = np.interp(t, given.t, np.sin(given.t)) + wave
    data["x"][9000:9100] = np.nan
    record = record_of(replace(given, t=t, data=data, valid=finite_masks(data)))
    assert record.dt == pytest.approx(0.01)
    inner = slice(50, -50)
    np.testing.assert_allclose(record.rate[inner, 0], np.sin(record.t[inner]), atol=2e-3)
    gap = (record.t > 9.0) & (record.t < 9.09)
    assert not record.pose_known[gap].any()
    assert record.motors_known[gap].all()


def test_velocity_is_the_derivative_of_the_position() -> None:
    t = np.arange(200) * 0.01
    position = np.column_stack([0.5 * t**2, np.sin(5.0 * t), 1.0 + 0.0 * t])
    expected = np.column_stack([t, 5.0 * np.cos(5.0 * t), 0.0 * t])
    np.testing.assert_allclose(differentiate(position, 0.01)[5:-5], expected[5:-5], atol=0.07)
    noise = np.random.default_rng(2).normal(0.0, 2e-4, (5000, 3))
    assert differentiate(noise, 0.01).std() == pytest.approx(2.6e-3, rel=0.1)


def test_our_own_records_become_records(tmp_path: Path) -> None:
    given = flight()
    folder = tmp_path / "run"
    with RunRecorder(folder, {"ceiling_z": 2.1}) as recorder:
        for i, t in enumerate(given.t):
            row = {name: float(values[i]) for name, values in given.data.items()}
            pose = {name: row[name] for name in ("x", "y", "z", "qx", "qy", "qz", "qw")}
            recorder.write("pose", t, {**pose, "frame": i, "verdict": "JUMPED" if 900 <= i < 910 else "OK"})
            recorder.write("rates", t + 0.003, {name: row[name] for name in ("gx", "gy", "gz")})
            recorder.write("acceleration", t + 0.003, {name: row[name] for name in ("ax", "ay", "az")})
            if i % 2 == 0:
                recorder.write("motors", t + 0.001, {name: row[name] for name in MOTORS})
            if i % 10 == 0:
                recorder.write("power", t + 0.002, {"vbat": row["vbat"]})
    record = record_of(open_flight(folder))
    assert record.ceiling_z == 2.1
    assert not record.pose_known[(record.t > 9.0) & (record.t < 9.09)].any()
    assert record.pose_known[(record.t > 9.11) & (record.t < 17.0)].all()
    assert record.voltage is not None
    np.testing.assert_allclose(record.voltage[20:-20], 4.1 - 0.01 * record.t[20:-20], atol=2e-3)
    reference = np.interp(record.t, given.t + 0.003, given.data["gz"])
    np.testing.assert_allclose(record.rate[:, 2], reference, atol=1e-6)


def test_the_drones_own_time_undoes_the_jitter_of_receipt(tmp_path: Path) -> None:
    given = flight()
    rng = np.random.default_rng(5)
    late = 0.004 + rng.exponential(0.006, (3, given.t.size))
    ahead = 1234.5  # the drone's clock
    with RunRecorder(tmp_path / "run", {}) as recorder:
        for i, t in enumerate(given.t):
            row = {name: float(values[i]) for name, values in given.data.items()}
            drone_ms = round((t + ahead) * 1e3)
            pose = {name: row[name] for name in ("x", "y", "z", "qx", "qy", "qz", "qw")}
            rates = {name: row[name] for name in ("gx", "gy", "gz")}
            recorder.write("pose", t + late[0, i], {**pose, "frame": i, "capture_time": t})
            recorder.write("rates", t + late[1, i], {**rates, "drone_time_ms": drone_ms})
            recorder.write(
                "motors", t + late[2, i], {**{m: row[m] for m in MOTORS}, "drone_time_ms": drone_ms}
            )
    record = record_of(open_flight(tmp_path / "run"))
    # The shortest way that any packet took, 4 ms, cannot be known; it is the same for all channels.
    onboard = slice(20, -20)
    rate = np.interp(record.t, given.t + 0.004, given.data["gy"])
    duty = np.interp(record.t, given.t + 0.004, given.data["m3"]) / 65535.0
    np.testing.assert_allclose(record.rate[onboard, 1], rate[onboard], atol=5e-4)
    np.testing.assert_allclose(record.duty[onboard, 2], duty[onboard], atol=0.01)
    np.testing.assert_allclose(
        record.position[:, 0], np.interp(record.t, given.t, given.data["x"]), atol=1e-5
    )
