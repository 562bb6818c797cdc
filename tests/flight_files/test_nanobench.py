"""Flights of the NanoBench data set."""

import gzip
from pathlib import Path

import numpy as np
import pytest

from calibration.flights import FlightFileError, PoseSource, UnusableFlightError, flight_files, open_flight
from onboard.gravity import GRAVITY

HEADER = (
    "t,px,py,pz,qx,qy,qz,qw,roll,pitch,yaw,vx,vy,vz,wx_vicon,wy_vicon,wz_vicon,"
    "imu_acc_x,imu_acc_y,imu_acc_z,imu_gyro_x,imu_gyro_y,imu_gyro_z,"
    "motor_motor_m1,motor_motor_m2,motor_motor_m3,motor_motor_m4,"
    "est_stateEstimate_x,est_stateEstimate_y,est_stateEstimate_z,"
    "sp_ctrltarget_x,sp_ctrltarget_y,sp_ctrltarget_z,pwr_pm_vbat"
)
COLUMNS = HEADER.split(",")


def row(t: float, **values: float | str) -> str:
    cells: dict[str, float | str] = {name: 10.0 + i for i, name in enumerate(COLUMNS)}
    cells |= {"t": t, "qx": 0.0, "qy": 0.0, "qz": 0.0, "qw": 1.0, **values}
    return ",".join(str(cells[name]) for name in COLUMNS)


def write(path: Path, *rows: str) -> Path:
    text = "\n".join([HEADER, *rows]) + "\n"
    if path.suffix == ".gz":
        path.write_bytes(gzip.compress(text.encode()))
    else:
        path.write_text(text)
    return path


def test_columns_become_channels_in_si(tmp_path: Path) -> None:
    values: dict[str, float | str] = {
        "imu_acc_z": 1.0,
        "imu_gyro_y": 0.5,
        "motor_motor_m2": 40000.0,
        "py": 0.7,
    }
    path = write(tmp_path / "B2_circle_rep1.csv.gz", row(5.0, **values), row(5.01, pwr_pm_vbat="nan"))
    flight = open_flight(path)
    assert (flight.format, flight.name) == ("nanobench", "B2_circle_rep1")
    assert flight.pose_source is PoseSource.MOCAP
    assert flight.data["az"][0] == pytest.approx(GRAVITY)
    assert (flight.data["gy"][0], flight.data["m2"][0], flight.data["y"][0]) == (0.5, 40000.0, 0.7)
    assert flight.valid["vbat"].tolist() == [True, False]


def test_an_occluded_frame_is_no_pose(tmp_path: Path) -> None:
    flight = open_flight(write(tmp_path / "a.csv", row(0.0), row(0.01, qw=0.0), row(0.02)))
    assert flight.valid["x"].tolist() == [True, False, True]
    assert flight.valid["gx"].all()


def test_errors_name_row_and_column(tmp_path: Path) -> None:
    with pytest.raises(FlightFileError, match="row 3 column 'imu_gyro_x': 'fast' is not a number"):
        open_flight(write(tmp_path / "a.csv", row(0.0), row(0.01, imu_gyro_x="fast")))
    with pytest.raises(FlightFileError, match="row 3 column 't': time goes back"):
        open_flight(write(tmp_path / "a.csv", row(1.0), row(0.5)))
    with pytest.raises(UnusableFlightError, match="only 1 data rows"):
        open_flight(write(tmp_path / "a.csv", row(0.0)))


def test_a_folder_gives_the_flights_in_it_and_not_the_metadata(tmp_path: Path) -> None:
    first = write(tmp_path / "b_rep1.csv.gz", row(0.0), row(0.01))
    second = write(tmp_path / "a_rep1.csv", row(0.0), row(0.01))
    (tmp_path / "b_rep1_metadata.yaml").write_text("crazyflie_id: CF_01\n")
    assert flight_files([tmp_path, second]) == [second, first, second]
    (tmp_path / "empty").mkdir()
    with pytest.raises(FlightFileError, match="no flight of a known format"):
        flight_files([tmp_path / "empty"])
    with pytest.raises(FlightFileError, match="no such file or folder"):
        flight_files([tmp_path / "missing"])


def test_public_flights(shared_data: Path) -> None:
    path = shared_data / "nanobench" / "B2_circle_fast_rep2.csv.gz"
    flight = open_flight(path)
    rest = flight.t < flight.t[0] + 1.0
    force = np.column_stack([flight.data[a] for a in ("ax", "ay", "az")])[rest].mean(axis=0)
    assert np.linalg.norm(force) == pytest.approx(GRAVITY, rel=0.01)
    assert force[2] > 9.7
    rate = np.column_stack([flight.data[g] for g in ("gx", "gy", "gz")])[rest]
    assert np.abs(rate).max() < 0.02
    assert 2.8 < flight.data["vbat"].min() < flight.data["vbat"].max() < 4.3
    assert flight.data["z"][rest].max() < 0.07
    assert 1.0 < flight.data["z"].max() < 1.3
