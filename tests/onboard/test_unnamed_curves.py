"""``[[unnamed]]`` of a vehicle file: read back as written, refused where no program could fly it."""

import tomllib
from pathlib import Path

import pytest

from onboard.vehicle import Vehicle, VehicleFileError, check_vehicle, load_vehicle, vehicle_to_toml
from onboard.vehicle.file_format import parse_vehicle
from onboard.vehicle.unnamed import CHANNELS, MOST_CURVES, MOST_KNOTS, REGRESSORS, UnnamedCurve

STOCK = load_vehicle("crazyflie21-stock")
FINE = """
[[unnamed]]
channel = "world_force_y"
regressor = "x"
knots = { values = [29, 31, 101, 103], unit = "cm" }
curve = { values = [0, 12.5, 12.5, 0], unit = "mN", sigma = 0.5, source = "gap finder; without a name" }
"""


def curve(channel: str = "force_x", regressor: str = "velocity_x", size: float = 0.01) -> UnnamedCurve:
    return UnnamedCurve(
        channel=channel,
        regressor=regressor,
        knots=(-1.0, 0.25, 2.0),
        values=(size, 0.0, -size / 3.0),
        sigma=1e-4,
        source="a test",
    )


def read(text: str) -> Vehicle:
    return parse_vehicle(tomllib.loads(vehicle_to_toml(STOCK) + text), "mine.toml")


def test_a_curve_is_read_in_si_units_with_its_provenance() -> None:
    (one,) = read(FINE).unnamed
    assert (one.channel, one.regressor) == ("world_force_y", "x")
    assert one.knots == pytest.approx([0.29, 0.31, 1.01, 1.03])
    assert one.values == pytest.approx([0.0, 0.0125, 0.0125, 0.0])
    assert one.sigma == pytest.approx(5e-4)
    assert one.source == "gap finder; without a name"


@pytest.mark.parametrize("channel", CHANNELS)
def test_every_curve_reads_back_as_it_was_written(channel: str) -> None:
    curves = [curve(channel, regressor, 1.0 / 3.0e3) for regressor in REGRESSORS][:MOST_CURVES]
    vehicle = STOCK.with_unnamed(curves)
    assert parse_vehicle(tomllib.loads(vehicle_to_toml(vehicle)), "copy") == vehicle


def test_a_vehicle_without_curves_is_written_without_a_word_of_them() -> None:
    assert "unnamed" not in vehicle_to_toml(STOCK)


@pytest.mark.parametrize(
    ("wrong", "right", "complaint"),
    [
        ("[29, 31, 101, 103]", "[29, 31, 31, 103]", "unnamed[0].knots: must increase"),
        ("[29, 31, 101, 103]", "[29, 101, 31, 103]", "unnamed[0].knots: must increase"),
        ("[29, 31, 101, 103]", "[29, 31, nan, 103]", "unnamed[0].knots.values[2]: is nan"),
        ("[29, 31, 101, 103]", "[29, 31, 101, inf]", "unnamed[0].knots.values[3]: is inf"),
        ("[29, 31, 101, 103]", "[29]", "unnamed[0].knots: has 1 values"),
        ("[29, 31, 101, 103]", str(list(range(MOST_KNOTS + 1))), "unnamed[0].knots: has 13 values"),
        ("[29, 31, 101, 103]", "[29, 31, 101]", "unnamed[0].curve: has 4 values for 3 knots"),
        ("[0, 12.5, 12.5, 0]", "[0, inf, 12.5, 0]", "unnamed[0].curve.values[1]: is inf"),
        ("[0, 12.5, 12.5, 0]", '[0, "much", 12.5, 0]', "unnamed[0].curve.values[1]: must be a number"),
        ("[0, 12.5, 12.5, 0]", "[0, 1e4, 12.5, 0]", "unnamed[0].curve: reaches 10 N; the rotors"),
        ("[0, 12.5, 12.5, 0]", "12.5", "unnamed[0].curve: must be a table"),
        ('unit = "mN"', 'unit = "m/s"', "unnamed[0].curve.unit: unit 'm/s' does not measure"),
        ('unit = "cm"', 'unit = "s"', "unnamed[0].knots.unit: unit 's' does not measure"),
        ("sigma = 0.5, ", "", "unnamed[0].curve.sigma: must be a number"),
        ("sigma = 0.5", "sigma = -0.5", "unnamed[0].curve.sigma: is -0.5"),
        (', source = "gap finder; without a name"', "", "unnamed[0].curve.source: is missing"),
        ('"world_force_y"', '"force"', "unnamed[0].channel: is 'force'; it must be one of force_x"),
        ('"x"', '"voltage"', "unnamed[0].regressor: is 'voltage'; it must be one of x"),
        ('regressor = "x"', 'regresor = "x"', "unnamed[0].regresor: unknown key; did you mean 'regressor'?"),
    ],
)
def test_a_curve_that_nobody_could_fly_is_refused(wrong: str, right: str, complaint: str) -> None:
    assert wrong in FINE
    with pytest.raises(VehicleFileError) as refused:
        read(FINE.replace(wrong, right))
    assert f"mine.toml: {complaint}" in str(refused.value)


def test_more_curves_than_can_be_flown_are_refused(tmp_path: Path) -> None:
    (tmp_path / "mine.toml").write_text(vehicle_to_toml(STOCK) + FINE * (MOST_CURVES + 1))
    (problem,) = check_vehicle(tmp_path / "mine.toml")
    assert problem.endswith("unnamed: holds 9 curves; at most 8 can be flown")


def test_a_table_that_is_no_array_is_refused() -> None:
    with pytest.raises(VehicleFileError, match=r"unnamed: must be an array of tables"):
        read("[unnamed]\nx = 1\n")


def test_at_the_knots_it_is_a_quantity_with_a_place_in_words() -> None:
    known = curve().at_knots()
    assert list(known) == [f"force_x at velocity_x = {knot} m/s" for knot in ("-1", "0.25", "2")]
    assert known["force_x at velocity_x = -1 m/s"].value == 0.01
    assert {quantity.unit for quantity in known.values()} == {"N"}
