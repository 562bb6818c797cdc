"""Channels in another unit or frame are refused by name, and near-copies are found."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from calibration.flights import Flight, open_flights
from calibration.gap.data import prepare_flights
from calibration.gap.data.duplicates import duplicate_of
from calibration.gap.data.smoothing import as_poses_see, force_from_poses
from calibration.gap.replay.hover_voltage import of_one_vehicle, with_voltages
from calibration.gap.replay.motor_order import MotorOrderError, check_motor_order
from calibration.gap.replay.teacher_forcing import teacher_forced
from onboard.room import RoomGeometry
from onboard.vehicle import load_vehicle
from sim_backend.physics.parameters import physics_parameters
from tests.truth import tunnel
from tests.truth.hidden_effects.campaign import make_flights

SEED = 4
STOCK = load_vehicle("crazyflie21-stock")


@pytest.fixture(scope="module")
def flights(tmp_path_factory: pytest.TempPathFactory) -> list[Flight]:
    folder = tmp_path_factory.mktemp("flights")
    files = make_flights("none", "medium", 3, 4, out=folder / "flights", answer=folder / "answer.json")
    return list(open_flights(files)[0])


@pytest.fixture(scope="module")
def flight(flights: list[Flight]) -> Flight:
    return flights[0]


def reason(flight: Flight, **data: np.ndarray) -> str:
    prepared = prepare_flights([replace(flight, data={**flight.data, **data})])
    return prepared.refused[0].reason if prepared.refused else ""


def test_a_sound_flight_is_not_refused(flight: Flight) -> None:
    assert reason(flight) == ""


def test_a_gyro_in_degrees_is_refused_by_name(flight: Flight) -> None:
    assert "deg/s" in reason(flight, **{k: np.degrees(flight.data[k]) for k in ("gx", "gy", "gz")})


def test_beside_more_that_are_in_another_unit_a_flight_that_cannot_be_told_is_not_used(
    tmp_path: Path,
) -> None:
    """Of eight flights in one wrong frame, the two that hardly turned were once believed."""
    one, *others = open_flights(
        make_flights("none", "medium", 3, 3, out=tmp_path / "f", answer=tmp_path / "a")
    )[0]
    wrong = [
        replace(flight, data=flight.data | {k: np.degrees(flight.data[k]) for k in ("gx", "gy", "gz")})
        for flight in others
    ]
    assert [record.name for record in prepare_flights([one, wrong[0]]).records] == [one.name]
    prepared = prepare_flights([one, *wrong])
    assert prepared.records == ()
    (told,) = (item.reason for item in prepared.refused if item.file == one.source)
    assert told.startswith("2 others were refused")
    assert told.endswith("convert all of them")


def test_millivolts_are_refused_by_name(flight: Flight) -> None:
    assert "mV" in reason(flight, vbat=1000.0 * flight.data["vbat"])


def test_millimetres_are_refused_by_name(flight: Flight) -> None:
    assert "positions seem to be in mm" in reason(
        flight, **{k: 1e3 * flight.data[k] for k in ("x", "y", "z")}
    )


def test_an_accelerometer_in_g_is_refused_by_name(flight: Flight) -> None:
    assert "in g" in reason(flight, **{k: flight.data[k] / 9.81 for k in ("ax", "ay", "az")})


def test_an_accelerometer_without_gravity_is_refused_by_name(flight: Flight) -> None:
    still = {k: flight.data[k] - (9.81 if k == "az" else 0.0) for k in ("ax", "ay", "az")}
    assert "gravity seems to be taken out" in reason(flight, **still)


@pytest.mark.parametrize("other", ["ax", "ay"])
def test_an_accelerometer_whose_axes_changed_places_is_refused_by_name(flight: Flight, other: str) -> None:
    swapped = {other: flight.data["az"], "az": flight.data[other]}
    assert "its axes are not those of the body" in reason(flight, **swapped)


def test_inertial_sensors_whose_z_points_down_are_refused_by_name(flight: Flight) -> None:
    assert "(forward, right, down)" in reason(
        flight, **{k: -flight.data[k] for k in ("ay", "az", "gy", "gz")}
    )


def test_a_room_whose_z_points_down_is_refused_by_name(flight: Flight) -> None:
    assert "z seems to point down" in reason(flight, **{k: -flight.data[k] for k in ("y", "z")})


@pytest.mark.parametrize(
    ("low", "high", "words"), [(1000.0, 2000.0, "pulse widths"), (48.0, 2047.0, "DShot")]
)
def test_motor_commands_of_another_range_are_refused_by_name(
    flight: Flight, low: float, high: float, words: str
) -> None:
    commands = {k: flight.data[k] / 65535.0 for k in ("m1", "m2", "m3", "m4")}
    assert words in reason(flight, **{k: low + (high - low) * v for k, v in commands.items()})


def test_a_quaternion_with_its_scalar_first_is_refused_by_name(flight: Flight) -> None:
    written, read = ("qw", "qx", "qy", "qz"), ("qx", "qy", "qz", "qw")
    said = reason(flight, **{column: flight.data[k] for column, k in zip(read, written, strict=True)})
    assert "scalar last" in said


@pytest.mark.parametrize("order", [(1, 0, 3, 2), (1, 2, 3, 0), (2, 3, 0, 1), (1, 0, 2, 3)])
def test_motors_in_another_order_are_refused_by_name(flight: Flight, order: tuple[int, ...]) -> None:
    """Such as PX4's, or clockwise from another corner: M1 is logged in the first column of `order`."""
    columns = [f"m{column + 1}" for column in order]
    numbered = {column: flight.data[f"m{motor}"] for motor, column in enumerate(columns, 1)}
    (record,) = prepare_flights([replace(flight, data={**flight.data, **numbered})]).records
    said = ", ".join(f"M{motor} is in {column}" for motor, column in enumerate(columns, 1))
    with pytest.raises(MotorOrderError, match=said):
        check_motor_order([record], STOCK)
    check_motor_order(prepare_flights([flight]).records, STOCK)


def turned_by_a_quarter(flight: Flight) -> Flight:
    """The flight in a body frame whose x is what y was, as the message says."""
    d, half = flight.data, math.sqrt(0.5)
    return replace(
        flight,
        data={
            **d,
            **{f"m{new}": d[f"m{old}"] for new, old in enumerate((4, 1, 2, 3), 1)},
            **{"gx": d["gy"], "gy": -d["gx"], "ax": d["ay"], "ay": -d["ax"]},
            **{"qx": half * (d["qx"] + d["qy"]), "qy": half * (d["qy"] - d["qx"])},
            **{"qz": half * (d["qz"] + d["qw"]), "qw": half * (d["qw"] - d["qz"])},
        },
    )


def test_rotors_that_turn_the_other_way_are_refused_by_name(flight: Flight) -> None:
    """In a frame that is turned by a quarter each rotor has its neighbour's place: again, and all is well."""
    other_way = turned_by_a_quarter(flight)
    with pytest.raises(MotorOrderError, match="its rotors turn the other way"):
        check_motor_order(prepare_flights([other_way]).records, STOCK)
    check_motor_order(prepare_flights([turned_by_a_quarter(other_way)]).records, STOCK)


@pytest.mark.parametrize(
    ("columns", "signs", "told"),
    [
        (("gy", "gx", "gz"), (1, -1, 1), "gx is about y, gy is about -x, gz is about z"),
        (("gx", "gy", "gz"), (1, -1, -1), "gx is about x, gy is about -y, gz is about -z"),
        (("gx", "gy", "gz"), (1, -1, 1), "gx is about x, gy is about -y, gz is about z"),
    ],
)
def test_a_gyro_whose_axes_are_others_is_refused_with_which(
    flight: Flight, columns: tuple[str, ...], signs: tuple[int, ...], told: str
) -> None:
    """A board that is turned by a quarter, one upside down, a sign that was lost."""
    mounted = {
        name: sign * flight.data[column]
        for name, column, sign in zip(("gx", "gy", "gz"), columns, signs, strict=True)
    }
    assert f"the gyro's axes are not those of the tracked body: {told}." in reason(flight, **mounted)


def test_rates_in_the_world_frame_are_refused_by_name(flight: Flight) -> None:
    heading = Rotation.from_euler("z", 1.2)
    quaternion = np.column_stack([flight.data[k] for k in ("qx", "qy", "qz", "qw")])
    attitude = heading * Rotation.from_quat(quaternion)
    rate = np.column_stack([flight.data[k] for k in ("gx", "gy", "gz")])
    turned = dict(zip(("qx", "qy", "qz", "qw"), attitude.as_quat().T, strict=True))
    assert reason(flight, **turned) == ""
    world = dict(zip(("gx", "gy", "gz"), attitude.apply(rate).T, strict=True))
    assert "world frame" in reason(flight, **turned, **world)


@pytest.mark.parametrize(("held", "said"), [(10, "refused"), (60, "limited"), (1, "neither")])
def test_a_flight_of_which_hardly_anything_is_known_is_refused(flight: Flight, held: int, said: str) -> None:
    """Commands that a log holds: 0.1 s of every 0.12 s leave nothing, 0.6 s of every 1.4 s a half."""
    rows = np.arange(flight.t.size)
    made_up = {10: rows % 12 < 10, 60: rows % 140 < 60, 1: rows < 0}[held]
    since = np.maximum.accumulate(np.where(made_up & (np.roll(made_up, 1)), 0, rows))
    commands = {k: flight.data[k][since] for k in ("m1", "m2", "m3", "m4")}
    told = prepare_flights([replace(flight, data={**flight.data, **commands})])
    refused = " ".join(one.reason for one in told.refused)
    assert ("% of the time in flight can be used: motor commands" in refused) == (said == "refused")
    limited = " ".join(told.limitations)
    assert ("less than half of the time in flight can be used" in limited) == (said == "limited")


def test_a_copy_that_was_cut_and_rounded_is_found(flight: Flight) -> None:
    keep = slice(300, None)
    cut = replace(
        flight,
        t=flight.t[keep],
        data={k: np.round(v[keep] + 1e-5, 4) for k, v in flight.data.items()},
        valid={k: v[keep] for k, v in flight.valid.items()},
    )
    (refused,) = prepare_flights([flight, cut]).refused
    assert "same numbers" in refused.reason


def test_two_flights_with_the_same_shock_are_no_copies(flight: Flight) -> None:
    """As of two landings: what the feet do to the gyro is alike, and far more than it shakes else."""
    rng = np.random.default_rng(3)
    shock = np.zeros(flight.t.size)
    shock[flight.t.size // 2 :][:6] = (12.0, 25.0, -18.0, 9.0, -5.0, 2.0)

    def shaken() -> Flight:
        gyro = {name: shock + rng.normal(0.0, 0.03, shock.size) for name in ("gx", "gy", "gz")}
        return replace(flight, data={**flight.data, **gyro})

    one, other = shaken(), shaken()
    later = replace(one, t=one.t + 1.0)
    assert duplicate_of([one, other, later]) == (None, None, one)


@pytest.mark.further
def test_forces_of_poses_are_those_of_the_model_seen_alike(tmp_path: Path) -> None:
    truth = tunnel.draw(SEED, 0.0)
    calm = truth._replace(linear=0.0, square=0.0)
    (file,) = tunnel.make_flights(calm, SEED, 1, tmp_path)
    (record,) = prepare_flights(open_flights([file])[0]).records
    vehicle = tunnel.nominal(calm)
    ((record,), _) = with_voltages([record], vehicle)
    assert record.dt == pytest.approx(0.02)
    assert not record.voltage_measured
    assert record.voltage is not None
    assert record.voltage.mean() == pytest.approx(tunnel.FULL_VOLTAGE, rel=0.01)
    predicted = teacher_forced(record, physics_parameters(vehicle, RoomGeometry(ceiling_z=1e3))).force
    left = (force_from_poses(record) - as_poses_see(record, predicted))[record.flying]
    assert np.nanstd(left, axis=0).max() < 0.25
    assert np.abs(np.nanmean(left, axis=0)).max() < 0.05


def test_commands_in_another_range_carry_no_vehicle(flights: list[Flight]) -> None:
    """Of logs without a voltage, which the vehicle's weight has to tell."""
    whole = flights[0]
    data = {name: values for name, values in whole.data.items() if name != "vbat"}
    valid = {name: known for name, known in whole.valid.items() if name != "vbat"}
    (record,) = prepare_flights([replace(whole, data=data, valid=valid)]).records
    carried, (never,) = with_voltages([replace(record, duty=0.02 * record.duty)], STOCK)
    assert carried == []
    assert "another range" in never.reason


def test_a_flight_of_another_vehicle_is_refused_by_name(flights: list[Flight]) -> None:
    records = list(prepare_flights(flights).records)
    records[2] = replace(records[2], name="heavy", duty=1.2 * records[2].duty)
    alike, refused = of_one_vehicle(records, STOCK)
    assert len(alike) == 3
    assert [(one.name, "another vehicle" in one.reason) for one in refused] == [("heavy", True)]
