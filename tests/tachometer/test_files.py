"""Files of recordings: what was written reads back, and what is broken is named by row."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from calibration.bench.motors.errors import TachometerError
from calibration.bench.motors.files import read_commands, read_tachometer, write_commands, write_edges
from calibration.bench.motors.records import CommandRecord, EdgeRecord, WindowRecord


@pytest.mark.parametrize("name", ["edges.csv", "edges.csv.gz"])
def test_edges_read_back(tmp_path: Path, name: str) -> None:
    record = EdgeRecord(np.array([0.5, 0.501234, 0.502]), np.array([7, 8, 12]), "x")
    write_edges(tmp_path / name, record)
    again = read_tachometer(tmp_path / name)
    assert isinstance(again, EdgeRecord)
    np.testing.assert_allclose(again.times, record.times, atol=1e-12)
    assert again.counts.tolist() == [7, 8, 12]


def test_commands_read_back(tmp_path: Path) -> None:
    write_commands(tmp_path / "c.csv", CommandRecord(np.array([1.0, 2.5]), np.array([0.0, 38400.0])))
    again = read_commands(tmp_path / "c.csv")
    assert again.times.tolist() == [1.0, 2.5]
    assert again.commands.tolist() == [0.0, 38400.0]


@pytest.mark.parametrize(
    ("header", "after"), [("time,omega", "1.7e9,1000"), ("t_us,edge_count", f"{17 * 10**14},4")]
)
def test_a_clock_that_jumps_by_years_is_named(header: str, after: str, tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    path.write_text("\n".join([header, "1,1", "2,2", "3,3", after]) + "\n")
    with pytest.raises(
        TachometerError, match=r"row 5 column .* time jumps by 1\.7e\+09 s; cut the recording"
    ):
        read_tachometer(path)


def test_counter_that_wraps_goes_on(tmp_path: Path) -> None:
    path = tmp_path / "wrap.csv"
    path.write_text(f"t_us,edge_count\n{2**32 - 1000},1\n{500},2\n{2500},3\n")
    record = read_tachometer(path)
    assert isinstance(record, EdgeRecord)
    np.testing.assert_allclose(np.diff(record.times), [1.5e-3, 2e-3])
    assert len(record.parts()) == 1


def test_reset_splits(tmp_path: Path) -> None:
    path = tmp_path / "reset.csv"
    path.write_text("t_us,edge_count\n9000000,1\n9001000,2\n500,1\n2500,2\n")
    record = read_tachometer(path)
    assert isinstance(record, EdgeRecord)
    assert [part.times.size for part in record.parts()] == [2, 2]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("t_us,edge_count\n1,2\nx,3\n", "row 3 column 't_us': 'x' is not a whole number"),
        ("t_us,edge_count\n1,2,3\n", "row 2: 3 cells"),
        ("time,omega\n0,nan\n1,2\n", "row 2 column 'omega': 'nan' is not a finite number"),
        ("time,omega\n0,1\n1,-2\n", "negative speed"),
        ("time,omega\n0,1\n1,1e300\n", "row 3 column 'omega': '1e300' is beyond 100000"),
        ("time,omega\n1,1\n0,2\n", "time goes back"),
        ("time,omega\n1,1\n", "at least two"),
        ("a,b\n1,1\n", "is not of a tachometer"),
        ("", "expected a header"),
    ],
)
def test_broken_files_are_named(tmp_path: Path, text: str, message: str) -> None:
    path = tmp_path / "broken.csv"
    path.write_text(text)
    with pytest.raises(TachometerError, match=message):
        read_tachometer(path)


def test_commands_out_of_range_and_missing_file(tmp_path: Path) -> None:
    (tmp_path / "c.csv").write_text("t_us,command\n1,70000\n")
    with pytest.raises(TachometerError, match="row 2 column 'command': 70000"):
        read_commands(tmp_path / "c.csv")
    with pytest.raises(TachometerError, match="check the path"):
        read_tachometer(tmp_path / "none.csv")
    (tmp_path / "bad.csv.gz").write_bytes(b"not gzip")
    with pytest.raises(TachometerError):
        read_tachometer(tmp_path / "bad.csv.gz")


@given(st.binary(max_size=200))
def test_any_bytes_are_read_or_refused(tmp_path_factory: pytest.TempPathFactory, raw: bytes) -> None:
    path = tmp_path_factory.mktemp("fuzz") / "f.csv"
    for head in (b"", b"t_us,edge_count\n", b"time,omega\n"):
        path.write_bytes(head + raw)
        try:
            record = read_tachometer(path)
        except TachometerError:
            continue
        assert isinstance(record, EdgeRecord | WindowRecord)


@given(st.lists(st.tuples(st.integers(0, 2**33), st.integers(0, 2**20)), max_size=80))
def test_any_edges_are_analysed_or_refused(rows: list[tuple[int, int]]) -> None:
    from calibration.bench.motors.analysis import analyse
    from calibration.bench.motors.propellers import propeller

    times = np.array([t * 1e-6 for t, _ in rows])
    record = EdgeRecord(times, np.array([n for _, n in rows], dtype=np.int64))
    try:
        analyse([record], propeller("P250"), 0.08)
    except TachometerError:
        return
