"""The authors' flights as they really are: every known defect of the files is met here."""

import gzip
from pathlib import Path

import numpy as np
import pytest

from calibration.flights import Flight, FlightFileError, UnusableFlightError, open_flight, open_flights
from calibration.flights.habas import TAU_TRUNCATION_S

POSE_JUMPS_NEAR_THE_TRIGGER = {  # docs/paper_errata.md 8
    "SVL--NL_2.25_40.00_10-26_17-21",
    "SVL--NL_2.25_50.00_10-26_17-34",
    "SVL--NL_2.75_45.00_10-26_17-42",
    "SVL--NL_2.75_50.00_10-26_17-37",
    "SVL--NL_2.75_50.00_10-27_10-28",
}


@pytest.fixture(scope="module")
def folder(shared_data: Path) -> Path:
    return shared_data / "habas2022" / "flights"


@pytest.fixture(scope="module")
def flights(folder: Path) -> dict[str, Flight]:
    opened, unusable = open_flights(sorted(folder.glob("*.csv.gz")))
    assert [(u.file.name, u.reason) for u in unusable] == [
        ("SVL--NL_2.50_80.00_10-27_11-00.csv.gz", "never leaves the floor (highest z 0.09 m)")
    ]
    return {f.name: f for f in opened}


@pytest.mark.slow
def test_all_are_read_and_commanded_conditions_known(flights: dict[str, Flight]) -> None:
    assert len(flights) == 38
    for name, flight in flights.items():
        speed, angle = name.split("_")[1:3]
        assert (flight.commanded_speed, flight.commanded_angle_deg) == (float(speed), float(angle))
        assert flight.format == "habas"


def test_the_ceiling_is_where_the_vehicle_reckoned_with_it(flights: dict[str, Flight]) -> None:
    for flight in flights.values():
        assert flight.ceiling_z == pytest.approx(2.079, abs=0.0011), flight.name


def test_29_flips_of_which_28_have_a_snapshot(flights: dict[str, Flight]) -> None:
    triggered = [f for f in flights.values() if f.trigger is not None]
    assert len(triggered) == 29
    snapshots = [f.trigger.snapshot for f in triggered if f.trigger is not None and f.trigger.snapshot]
    assert len(snapshots) == 28
    for s in snapshots:
        # tau = d_ceil / v_z, but for the age of v_z; theta_x positive, as in the paper
        assert s["tau"] + TAU_TRUNCATION_S == pytest.approx(s["d_ceil"] / s["vz"], abs=4e-3)
        assert s["theta_x"] == pytest.approx(s["vx"] / s["d_ceil"], abs=0.02)
        assert s["theta_x"] > -0.1


def test_a_rot_and_pitch_agree_in_sign_and_size(flights: dict[str, Flight]) -> None:
    means = []
    for flight in flights.values():
        if flight.trigger is None:
            continue
        t, moment = flight.series("a_rot")
        first = moment[(t >= flight.trigger.t) & (t < flight.trigger.t + 0.15), 0]
        means.append(float(np.median(first)))
        t, rate = flight.series("gy")
        assert np.min(rate[(t > flight.trigger.t) & (t < flight.trigger.t + 0.3)]) < -3.0  # nose up
    assert np.mean(means) == pytest.approx(-6.65e-3, abs=0.25e-3)
    assert -8.2e-3 < min(means) < max(means) < -4.5e-3


def test_motors_are_renumbered_front_right_first(flights: dict[str, Flight]) -> None:
    flips = 0
    for flight in flights.values():
        if flight.trigger is None:
            continue
        rows = (flight.t > flight.trigger.t + 0.06) & (flight.t < flight.trigger.t + 0.15)
        front = flight.data["f1"][rows] + flight.data["f4"][rows]
        rear = flight.data["f2"][rows] + flight.data["f3"][rows]
        flips += bool(np.max(front) > 0.12)  # N: two motors of 7-13 g
        assert np.max(rear) == 0.0
    assert flips >= 26  # in the others a pose jump cut the motors at once
    hover = flights["SVL--NL_2.50_50.00_10-26_16-52"]
    # tau_z = c (F2 + F4 - F1 - F3) with Bitcraze's numbering: the logged Mz follows it, sign and all
    rows = (hover.data["collective"] > 0.3) & (hover.data["z"] > 0.3)
    torque = sum(s * hover.data[m][rows] for s, m in ((-1, "f1"), (1, "f2"), (-1, "f3"), (1, "f4")))
    roll = sum(s * hover.data[m][rows] for s, m in ((-1, "f1"), (-1, "f2"), (1, "f3"), (1, "f4")))
    assert np.corrcoef(torque, hover.data["moment_z"][rows])[0, 1] > 0.8
    assert np.corrcoef(roll, hover.data["moment_x"][rows])[0, 1] > 0.8


def test_leftover_flags_at_the_head_are_no_trigger(flights: dict[str, Flight]) -> None:
    for flight in flights.values():
        head = flight.t < flight.t[0] + 3.0
        assert not flight.data["triggered"][head].any()
        if flight.trigger is not None:
            before = flight.t < flight.trigger.t - 0.1
            assert not flight.data["triggered"][before].any()


def test_pose_jumps_are_found_where_they_are_known(flights: dict[str, Flight]) -> None:
    early = set()
    for name, flight in flights.items():
        if flight.trigger is None:
            continue
        rows = (flight.t >= flight.trigger.t) & (flight.t < flight.trigger.t + 0.15)
        if not flight.valid["z"][rows].all():
            early.add(name)
            assert any("onboard pose impossible" in note for note in flight.notes)
    assert early >= POSE_JUMPS_NEAR_THE_TRIGGER
    assert len(early) <= 6


def test_what_is_no_value_is_not_valid(flights: dict[str, Flight]) -> None:
    for flight in flights.values():
        assert not flight.valid["vbat"][flight.data["vbat"] <= 3.5].any()
        assert not flight.valid["trigger_value"][flight.data["trigger_value"] <= -32.7].any()
        assert not flight.valid["tau"][np.isinf(flight.data["tau"])].any()
        _, tau = flight.series("tau")
        assert (tau > 0.0).all()
        _, pose = flight.series("x", "y", "z")
        assert pose[:, 2].max() < 2.15


def test_frozen_telemetry_is_cut_off(flights: dict[str, Flight]) -> None:
    flight = flights["SVL--NL_2.50_35.00_10-26_17-12"]
    assert any("telemetry frozen" in note for note in flight.notes)
    t, _ = flight.series("gx")
    assert flight.t[-1] - t[-1] > 10.0


@pytest.fixture
def lines(folder: Path) -> list[str]:
    with gzip.open(folder / "SVL--NL_2.50_40.00_10-26_16-34.csv.gz", "rt") as stream:
        return stream.read().splitlines()


def test_broken_files_name_row_and_column(lines: list[str], tmp_path: Path) -> None:
    path = tmp_path / "broken.csv"

    def broken(row: int, old: str, new: str) -> str:
        copy = [*lines]
        copy[row - 1] = copy[row - 1].replace(old, new, 1)
        path.write_text("\n".join(copy))
        with pytest.raises(FlightFileError) as caught:
            open_flight(path)
        return str(caught.value)

    cells = lines[99].split(",")
    assert f"{path} row 100 column 'z': 'two' is not a number" in broken(100, f",{cells[10]},", ",two,")
    assert "row 100 column 'flip_flag': 'maybe'" in broken(100, ",False,", ",maybe,")
    assert "row 100: 55 cells where the header has 56" in broken(100, ",False", "")
    assert "row 100 column 't': time goes back" in broken(100, f",{cells[2]},", ",0.1,")
    path.write_bytes(gzip.compress("\n".join(lines).encode())[:5000])
    path.rename(tmp_path / "cut.csv.gz")
    with pytest.raises(FlightFileError, match=r"cut\.csv\.gz: cannot be read after row \d+"):
        open_flight(tmp_path / "cut.csv.gz", "habas")


def test_a_log_without_flight_is_unusable_not_broken(folder: Path) -> None:
    with pytest.raises(UnusableFlightError, match="never leaves the floor"):
        open_flight(folder / "SVL--NL_2.50_80.00_10-27_11-00.csv.gz")
