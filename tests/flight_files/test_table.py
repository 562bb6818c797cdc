"""Plain tables and the detection of formats."""

import math
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from calibration.flights import FlightFileError, PoseSource, UnusableFlightError, open_flight
from calibration.flights.formats import flight_files
from onboard.errors import InputError
from tests.drawn_examples import examples

HEADER = "t,x,y,z,qx,qy,qz,qw"


def write(path: Path, header: str, *rows: str) -> Path:
    path.write_text("\n".join([header, *rows]) + "\n")
    return path


def test_a_table_with_gaps(tmp_path: Path) -> None:
    path = write(
        tmp_path / "a.csv", HEADER + ",gx,gy,gz,vbat", "0,1,2,3,0,0,0,1,,,,4.1", "0.1,,,,,,,,0.1,0.2,0.3,"
    )
    flight = open_flight(path)
    assert (flight.format, flight.pose_source, flight.trigger) == ("table", PoseSource.MOCAP, None)
    t, position = flight.series("x", "y", "z")
    assert t.tolist() == [0.0]
    assert position.tolist() == [[1.0, 2.0, 3.0]]
    assert flight.series("gy")[1].tolist() == [[0.2]]
    assert flight.has("vbat", "gx")
    assert not flight.has("ax")


def test_a_last_row_that_was_cut_off_costs_itself_alone(tmp_path: Path) -> None:
    whole = write(tmp_path / "a.csv", HEADER, "0,1,2,3,0,0,0,1", "0.1,1,2,3,0,0,0,1", "0.2,1,2,3,0,0,0,1")
    text = whole.read_text()
    for end in range(text.rindex("0.2"), len(text) - 1):
        whole.write_text(text[:end])
        last = text[text.rindex("0.2") : end]
        flight = open_flight(whole)
        cut_off = 0 < last.count(",") + bool(last) < 8
        assert flight.t.size == (2 if cut_off or not last else 3)
        assert flight.notes == (
            (f"row 4 is cut off after {last.count(',') + 1} cells: left out",) if cut_off else ()
        )
    cut_number = text.replace("0.2,1,2,3,0,0,0,1", "0.2,1,2,3,0,0,0.199,0.98")
    for end in range(cut_number.rindex("0.98"), len(cut_number) - 1):
        whole.write_text(cut_number[:end])
        flight = open_flight(whole)
        told = flight.t.size == 3 or flight.notes == ("row 4 is cut off in its last number: left out",)
        assert told, cut_number[:end]
        norms = np.linalg.norm(flight.series("qx", "qy", "qz", "qw")[1], axis=1)
        assert norms == pytest.approx(1.0, abs=0.05)
    whole.write_text(cut_number.replace("0.98", "0."))
    with pytest.raises(FlightFileError, match=r"row 4 .*: not a unit quaternion"):
        open_flight(whole)  # a line with an end is whole, and wrong
    whole.write_text(text.replace("0.2,1,2,3,0,0,0,1\n", "0.2,1,2,up,0,0,0,1"))
    with pytest.raises(FlightFileError, match="row 4 column 'z': 'up' is not a number"):
        open_flight(whole)  # no cut makes this
    whole.write_text(text.replace("0.1,1,2,3,0,0,0,1", "0.1,1,2"))
    with pytest.raises(FlightFileError, match="row 3: 3 cells where the header has 8"):
        open_flight(whole)


def test_a_last_row_whose_time_was_cut_costs_itself_alone(tmp_path: Path) -> None:
    path = write(
        tmp_path / "a.csv", "x,y,z,qx,qy,qz,qw,t", *(f"1,2,3,0,0,0,1,{t}" for t in ("9.8", "9.9", "10.0"))
    )
    text = path.read_text()
    for end in range(text.rindex("10.0") + 1, len(text) - 1):
        path.write_text(text[:end])
        flight = open_flight(path)
        told = flight.t.size == 3 or flight.notes == ("row 4 is cut off in its last number: left out",)
        assert told, text[:end]
        assert flight.t[-1] in (9.9, 10.0)
    path.write_text(text.replace("1,10.0\n", "up,10"))
    with pytest.raises(FlightFileError, match="row 4 column 'qw': 'up' is not a number"):
        open_flight(path)


@pytest.mark.parametrize(("sign", "words"), [(";", "semicolons"), ("\t", "tabs")])
def test_columns_separated_otherwise_are_named(sign: str, words: str, tmp_path: Path) -> None:
    """As a spreadsheet writes them where a comma stands in numbers."""
    path = write(tmp_path / "a.csv", HEADER.replace(",", sign), sign.join(["0"] * 8))
    with pytest.raises(FlightFileError, match=f"separated by {words}: write it with commas"):
        open_flight(path)
    with pytest.raises(FlightFileError, match=f"no flight .* in this folder: a.csv has columns .* {words}"):
        flight_files([tmp_path])


def test_truth_files_of_the_lab_are_tables(tmp_path: Path) -> None:
    header = "t,drone,x,y,z,qx,qy,qz,qw,vx,vy,vz,wx,wy,wz,legs_attached,body_contact"
    row = "{},{},0,0,1,0,0,0,1,0,0,0,1,2,3,4,0"
    flight = open_flight(write(tmp_path / "truth.csv", header, row.format(0, "cf1"), row.format(1, "cf1")))
    assert flight.pose_source is PoseSource.TRUTH
    assert flight.data["gy"].tolist() == [2.0, 2.0]
    path = write(tmp_path / "two.csv", header, row.format(0, "cf1"), row.format(1, "cf2"))
    with pytest.raises(FlightFileError, match="2 drones in one table"):
        open_flight(path)


def test_a_table_says_that_its_pose_is_the_onboard_estimate(tmp_path: Path) -> None:
    rows = ("0,1,2,3,0,0,0,1,onboard_estimate", "0.1,1,2,3,0,0,0,1,", "0.2,1,2,3,0,0,0,1,onboard_est")
    path = write(tmp_path / "a.csv", f"{HEADER},pose_source", *rows[:2])
    assert open_flight(path).pose_source is PoseSource.ONBOARD_ESTIMATE
    path.write_text("\n".join([f"{HEADER},pose_source", *rows]))  # cut off while it was written
    flight = open_flight(path)
    assert (flight.pose_source, flight.t.size) == (PoseSource.ONBOARD_ESTIMATE, 2)


@pytest.mark.parametrize(
    ("header", "rows", "message"),
    [
        (HEADER, ("0,0,0,0,0,0,0,1", "1,0,0,up,0,0,0,1"), "row 3 column 'z': 'up' is not a number"),
        (HEADER, ("0,0,0,0,0,0,0,1", "1,0,0,0,0,0,0,2"), "row 3 columns 'qx'..'qw': not a unit quaternion"),
        (HEADER, ("1,0,0,0,0,0,0,1", "0,0,0,0,0,0,0,1"), "row 3 column 't': time goes back"),
        (HEADER, ("0,0,0,0,0,0,0,1", ",0,0,0,0,0,0,1"), "row 3 column 't': no time"),
        (HEADER, ("0,0,0,0,0,0,0,1", "1,0,0"), "row 3: 3 cells where the header has 8"),
        (HEADER + ",speed", ("0,0,0,0,0,0,0,1,1",), "unknown column speed"),
        (HEADER + ",gx,wx", ("0,0,0,0,0,0,0,1,1,1",), "column given twice"),
        ("t,x,y,z", ("0,0,0,0",), "no column 'qx'"),
        (
            HEADER + ",pose_source",
            ("0,0,0,0,0,0,0,1,mocap", "1,0,0,0,0,0,0,1,ekf"),
            "row 3 column 'pose_source': 'ekf' is none of mocap, onboard_estimate, truth",
        ),
        (
            HEADER + ",pose_source",
            ("0,0,0,0,0,0,0,1,mocap", "1,0,0,0,0,0,0,1,onboard_estimate"),
            "2 sources in one table",
        ),
    ],
)
def test_errors_name_row_and_column(tmp_path: Path, header: str, rows: tuple[str, ...], message: str) -> None:
    path = write(tmp_path / "bad.csv", header, *rows)
    with pytest.raises(FlightFileError) as caught:
        open_flight(path, "table")
    assert str(path) in str(caught.value)
    assert message in str(caught.value)
    assert isinstance(caught.value, InputError)


def test_formats_that_nobody_knows(tmp_path: Path) -> None:
    with pytest.raises(FlightFileError, match="of no known flight format; known are perchhw, habas, table"):
        open_flight(write(tmp_path / "b.csv", "a,b", "1,2"))
    with pytest.raises(FlightFileError, match="unknown flight format 'px4'"):
        open_flight(write(tmp_path / "b.csv", HEADER, "0,0,0,0,0,0,0,1"), "px4")
    with pytest.raises(FlightFileError, match="no such file"):
        open_flight(tmp_path / "missing.csv")
    with pytest.raises(FlightFileError, match="empty first row"):
        open_flight(write(tmp_path / "e.csv", ""), "table")
    with pytest.raises(UnusableFlightError, match="only 1 data rows"):
        open_flight(write(tmp_path / "s.csv", HEADER, "0,0,0,0,0,0,0,1"))


def test_a_flip_is_inferred_when_no_column_tells_it(tmp_path: Path) -> None:
    rows = []
    for i in range(11):
        half = i * 0.1 * math.pi / 2
        rows.append(f"{i * 0.1},0,0,1,0,{-math.sin(half)},0,{math.cos(half)}")
    flight = open_flight(write(tmp_path / "flip.csv", HEADER, *rows))
    assert flight.trigger is not None
    assert flight.trigger.t == pytest.approx(0.4)  # 0.1 s is 18 deg: the first row beyond 60 deg
    assert flight.notes == (
        "no column triggered: 60 deg of tilt at 0.40 s are taken for a flip, and may be a crash",
    )


@settings(max_examples=examples(200), suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    content=st.one_of(st.binary(max_size=300), st.text("t,xyzqw01.\n-e \"'", max_size=200).map(str.encode))
)
def test_no_content_raises_anything_but_an_error_of_ours(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "noise.csv"
    for head in (b"", HEADER.encode() + b"\n"):
        path.write_bytes(head + content)
        for format in ("auto", "table", "habas"):
            with suppress(FlightFileError, UnusableFlightError):
                flight = open_flight(path, format)
                assert flight.format == "table"
                assert np.all(np.diff(flight.t) >= 0)
