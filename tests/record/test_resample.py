"""A flight on one clock: nothing is invented where nothing was measured."""

import importlib.util
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from calibration.flights.flight import Flight, PoseSource, finite_masks
from calibration.flights.resample import GAP_PERIODS, ResampleError, resample
from onboard.arrays import FloatArray
from perchhw.record.export import ExportFormat, export_run
from perchhw.record.run import read_run
from tests.view.flown import BEGIN, GONE, STEPS, record

needs_pandas = pytest.mark.skipif(
    importlib.util.find_spec("pandas") is None, reason="pandas is not installed: pip install pandas"
)


def flight(t: FloatArray, **data: FloatArray) -> Flight:
    columns = {name: np.asarray(values, dtype=np.float64) for name, values in data.items()}
    return Flight("f", Path("f"), "table", PoseSource.MOCAP, t, columns, finite_masks(columns))


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return record(tmp_path_factory.mktemp("resample") / "run")


@given(
    steps=st.lists(st.sampled_from([0.01, 0.01, 0.01, 0.02, 0.03, 0.2]), min_size=3, max_size=40),
    values=st.data(),
    rate_hz=st.sampled_from([50.0, 100.0, 333.0]),
)
def test_values_lie_between_their_neighbours_and_none_in_a_gap(
    steps: list[float], values: st.DataObject, rate_hz: float
) -> None:
    t = np.concatenate([[5.0], 5.0 + np.cumsum(steps)])
    x = np.array(values.draw(st.lists(st.floats(-9.0, 9.0), min_size=t.size, max_size=t.size)))
    result = resample(flight(t, x=x), rate_hz)
    assert np.diff(result.t) == pytest.approx(1.0 / rate_hz)
    assert t[-1] - 1.0 / rate_hz - 1e-6 < result.t[-1] <= t[-1] + 1e-6
    bridged = GAP_PERIODS * float(np.median(steps))
    for time, value in zip(result.t, result.data["x"], strict=True):
        near = np.flatnonzero(np.abs(t - time) < 2e-6)
        if near.size:
            assert value == pytest.approx(x[near[0]], abs=1e-2)
            continue
        after = int(np.searchsorted(t, time))
        assert np.isnan(value) == (t[after] - t[after - 1] > bridged + 1e-9)
        if not np.isnan(value):
            low, high = sorted((x[after - 1], x[after]))
            assert low - 1e-9 <= value <= high + 1e-9


def test_an_attitude_stays_one_though_its_sign_flips() -> None:
    t = np.linspace(0.0, 1.0, 51)
    angle = 12.0 * t
    sign = np.where(np.arange(51) % 3 == 0, -1.0, 1.0)
    turns = {"qx": 0.0 * t, "qy": np.sin(angle / 2) * sign, "qz": 0.0 * t, "qw": np.cos(angle / 2) * sign}
    result = resample(flight(t, **turns), 200.0)
    found = 2.0 * np.unwrap(np.arctan2(result.data["qy"], result.data["qw"]) % np.pi, period=np.pi)
    assert found == pytest.approx(12.0 * result.t, abs=1e-3)
    norm = np.sqrt(sum(result.data[name] ** 2 for name in turns))
    assert norm == pytest.approx(1.0)


def test_what_switches_is_held() -> None:
    t = np.arange(5) * 0.1
    result = resample(flight(t, landing_state=np.array([0.0, 0.0, 2.0, 3.0, 3.0])), 40.0)
    assert set(result.data["landing_state"]) == {0.0, 2.0, 3.0}


@pytest.mark.parametrize("rate_hz", [0.0, -1.0, float("nan"), 1e9])
def test_what_is_no_rate_is_refused(rate_hz: float) -> None:
    with pytest.raises(ResampleError, match="rate"):
        resample(flight(np.arange(3.0), x=np.zeros(3)), rate_hz)


def test_parquet_carries_units_and_one_clock(folder: Path, tmp_path: Path) -> None:
    from pyarrow import parquet

    files = {path.name: path for path in export_run(read_run(folder), tmp_path, ExportFormat.PARQUET, 50.0)}
    cues = parquet.read_schema(files["cues.parquet"])
    assert cues.field("theta_x").metadata[b"unit"] == b"1/s"
    table = parquet.read_table(files["resampled.parquet"])
    assert table.schema.metadata[b"rate_hz"] == b"50"
    assert b"2.5 periods" in table.schema.metadata[b"interpolation"]
    assert {table.schema.field(name).metadata[b"unit"] for name in ("t", "tau", "cues_drone_time")} == {b"s"}
    assert all(field.metadata[b"unit"] for field in table.schema)
    t = table.column("t").to_numpy()
    assert t[0] == pytest.approx(BEGIN)
    assert np.diff(t) == pytest.approx(0.02, abs=1e-9)


@needs_pandas
def test_a_run_as_a_table_of_pandas(folder: Path) -> None:
    import perchhw

    run = perchhw.read_run(str(folder))
    rows, clocked = run.to_pandas(), run.to_pandas(rate_hz=100.0)
    assert rows.index.name == "t"
    assert np.isnan(rows["x"].iloc[GONE])
    assert np.isnan(rows["tau"].iloc[1])  # minus infinity is no time to contact
    assert clocked.attrs["units"]["gx"] == "rad/s"
    assert clocked.shape[0] == STEPS
    assert clocked["x"].iloc[GONE] == pytest.approx(-1.0 + 0.008 * GONE)  # one missing pose is bridged
    assert clocked["vbat"].iloc[-1] == pytest.approx(3.9)
