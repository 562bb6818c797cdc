"""The ranges of a lab file's numbers: what lies outside is refused with key, value, range and reason."""

import math
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from onboard.bounds import Bounds
from onboard.lab_file import LabFileError, parse_lab
from onboard.quantity import convert
from onboard.room import RoomGeometry
from onboard.toml_file import read_toml
from perchhw.lab import limits_of
from perchhw.lab.flying import LIMITS
from tests.conftest import REPOSITORY
from tests.lab_file.labs import LAB
from tests.lab_file.range_tables import places_table

FILE = "lab.toml"
names = st.sampled_from(sorted(LIMITS))


def with_limits(folder: Path, text: str) -> str:
    """The refusal of the lab with these limits, or nothing."""
    path = folder / FILE
    path.write_text(f"{LAB}[limits]\n{text}\n")
    return refusal(path)


def refusal(path: Path) -> str:
    try:
        parse_lab(read_toml(path, LabFileError), FILE, LIMITS)
    except LabFileError as error:
        return str(error)
    return ""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("ranges")


@given(data=st.data(), name=names)
def test_what_lies_inside_its_range_reaches_the_flight(folder: Path, data: st.DataObject, name: str) -> None:
    bounds = LIMITS[name]
    value = data.draw(st.floats(bounds.least, bounds.most))
    (folder / FILE).write_text(f"{LAB}[limits]\n{name} = {value!r}\n")
    lab = parse_lab(read_toml(folder / FILE, LabFileError), FILE, LIMITS)
    assert getattr(limits_of(lab, RoomGeometry(), lab.drones[0].uri), name) == value


@given(data=st.data(), name=names)
def test_what_lies_outside_is_refused_with_key_value_range_and_reason(
    folder: Path, data: st.DataObject, name: str
) -> None:
    bounds = LIMITS[name]
    below = st.floats(max_value=bounds.least, exclude_max=True, allow_infinity=False)
    above = st.floats(min_value=bounds.most, exclude_min=True, allow_infinity=False)
    value = data.draw(below | above)
    said = with_limits(folder, f"{name} = {value!r}")
    assert said.startswith(f"{FILE}: limits.{name}: is {value:g} {bounds.unit}; it must be {bounds.text}: ")
    assert (bounds.why_least if value < bounds.least else bounds.why_most) in said
    assert "\n" not in said


@pytest.mark.parametrize(("name", "bounds"), LIMITS.items())
def test_both_ends_are_allowed_in_the_unit_that_is_shown(folder: Path, name: str, bounds: Bounds) -> None:
    unit = "deg" if bounds.unit == "rad" else bounds.unit
    for end in (bounds.least, bounds.most):
        value = float(f"{convert(end, bounds.unit, unit):.6g}")
        table = f'{{ value = {value!r}, unit = "{unit}", sigma = 0, source = "x" }}'
        assert with_limits(folder, f"{name} = {table}") == ""


@pytest.mark.parametrize(
    ("line", "hint"),
    [
        ("tilt_in_hover = 25", 'degrees; write radians (0.4363), or { value = 25, unit = "deg", sigma = 0,'),
        ("yaw_disagreement = 3", "looks like degrees"),
        ("hang_tilt = 200", "looks like degrees"),
        ("tilt_in_hover = 1.5", None),
        ('tilt_in_hover = { value = 200, unit = "deg", sigma = 0, source = "x" }', None),
        ("speed_in_hover = 25", None),
    ],
)
def test_degrees_that_are_written_as_radians_are_recognised(
    folder: Path, line: str, hint: str | None
) -> None:
    said = with_limits(folder, line)
    assert "it must be" in said
    assert ("degrees" in said) == (hint is not None)
    assert (hint or "") in said


@pytest.mark.parametrize(
    ("old", "new", "hint"),
    [
        ("[limits]", "[limits]\npose_age = 90", "milliseconds; write seconds (0.09)"),
        ("[limits]", "[limits]\nbattery_at_rest = 3850", "millivolts; write volts (3.85)"),
        ("x_min = -3.0", "x_min = -300", "centimetres; write metres (-3)"),
        ("x_min = -3.0", "x_min = -1e9", None),
    ],
)
def test_a_number_in_another_unit_is_recognised(folder: Path, old: str, new: str, hint: str | None) -> None:
    text = f"{LAB}[limits]\n"
    assert old in text
    (folder / FILE).write_text(text.replace(old, new, 1))
    said = refusal(folder / FILE)
    assert "it must be" in said
    assert ("looks like" in said) == (hint is not None)
    assert (hint or "") in said


@pytest.mark.parametrize(
    "text",
    [
        "tilt_in_hover = 25",
        "battery_at_rest = 0.1",
        "pose_age = 100",
        "link_silence = 1e9",
        "link_silence = 60",
        "speed_in_hover = 1000",
    ],
)
def test_what_once_took_off_is_refused(folder: Path, text: str) -> None:
    assert f"limits.{text.split()[0]}: is " in with_limits(folder, text)


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("x_min = -3.0", "x_min = -1e9", "room.x_min: is -1e+09 m; it must be -50 to 50 m"),
        ("y_max = 1.2", "y_max = 50.1", "room.y_max: is 50.1 m; it must be -50 to 50 m"),
        (
            "y_min = -1\n",
            "y_min = 0.71\n",
            "room.y_min: is 0.71 m; it must be less than y_max, 1.2 m, by 0.5",
        ),
        (
            "sigma = 1,",
            "sigma = 11,",
            "room.x_max: has a sigma of 11 cm; it must be known to 0.1 m or better",
        ),
        ("2.4,", "{ value = 2.4, unit = 'm', sigma = 5, source = 'x' },", "height: has a sigma of 5 m"),
        ("height = 2.4", "height = 100", "room.ceiling.height: is 100 m; it must be 1 to 4 m"),
        ("tilt_x_deg = 1.0", "tilt_x_deg = 12", "tilt_x_deg: is 12 deg; it must be -4 to 4 deg: drone, sim"),
        ("tilt_x_deg = 1.0", "tilt_x_deg = 3, tilt_y_deg = -3", "ceiling: tilts by 4.2 deg along x and y"),
        ('"cf1"', '"cf1"\nlatency_s = 5', "mocap.latency_s: is 5 s; it must be 0 to 0.035 s"),
        ('"cf1"', '"cf1"\nsubject_to_body = { position = [0, -31, 0] }', "position[1]: is -31 m; it must"),
        ("yaw_deg = 2", "yaw_deg = 361", "room.start.yaw_deg: is 361 deg; it must be -360 to 360 deg"),
        ("[room]", 'clock = "127.0.0.1:4"\n[room]', "room.ceiling: tilts; the ceilings of simulated rooms"),
    ],
)
def test_a_room_that_nothing_flies_in_is_refused(folder: Path, old: str, new: str, said: str) -> None:
    assert old in LAB
    path = folder / FILE
    path.write_text(LAB.replace(old, new, 1))
    assert said in refusal(path)


def test_a_ceiling_stays_above_the_floor_as_far_as_the_walls(folder: Path) -> None:
    path, text = folder / FILE, LAB.replace("x_min = -3.0", "x_min = -40.0").replace("2.4,", "1.0,")
    path.write_text(text)
    assert refusal(path) == ""
    path.write_text(text.replace("tilt_x_deg = 1.0", "tilt_x_deg = 2.0"))
    assert "room.ceiling: comes down to -0.39" in refusal(path)


@given(st.floats(-4.0, 4.0), st.floats(-4.0, 4.0))
def test_the_plane_is_as_level_as_its_tilts_must_be(folder: Path, x: float, y: float) -> None:
    path = folder / FILE
    path.write_text(LAB.replace("tilt_x_deg = 1.0", f"tilt_x_deg = {x!r}, tilt_y_deg = {y!r}"))
    slope = math.hypot(math.tan(math.radians(x)), math.tan(math.radians(y)))
    limit = math.tan(math.radians(4.0))
    if not math.isclose(slope, limit):
        assert (refusal(path) == "") == (slope < limit)


def test_the_page_shows_the_ranges_of_the_room() -> None:
    page = (REPOSITORY / "docs" / "lab_file.md").read_text(encoding="utf-8")
    assert f"\n\n{places_table()}\n\n" in page, f"docs/lab_file.md should have:\n{places_table()}"


@given(st.floats())
def test_only_numbers_lie_in_a_range(value: float) -> None:
    assert Bounds("m", -math.inf, math.inf, "").contains(value) == (not math.isnan(value))
