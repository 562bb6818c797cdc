"""The lab file: what is read from it, that the writer's text reads back, and what is said of a wrong one."""

import math
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from onboard.lab_file import (
    Ceiling,
    LabDrone,
    LabFile,
    LabFileError,
    LabMocap,
    LabRoom,
    StartMark,
    SubjectToBody,
    drone_addresses,
    plain,
    read_lab_file,
    split_subject,
    with_subject,
    write_lab_file,
)
from onboard.quantity import Quantity
from tests.lab_file.labs import LAB, RULES

TWIN = '[[drones]]\nuri = "udp://127.0.0.1:19850?time=shm"\nvehicle = "v"\n'


@pytest.fixture
def file(tmp_path: Path) -> Path:
    path = tmp_path / "lab.toml"
    path.write_text(LAB)
    return path


def test_plain_numbers_and_quantities_are_read(file: Path) -> None:
    lab = read_lab_file(file, RULES)
    room = lab.room.geometry()
    assert (room.x_min, room.x_max, room.y_min, room.y_max, room.floor_z) == (-3.0, 1.5, -1.0, 1.2, 0.0)
    assert lab.room.x_max.sigma == pytest.approx(0.01)
    assert room.ceiling_at(0.0, 5.0) == 2.4
    assert room.ceiling_at(1.0, 0.0) == pytest.approx(2.4 + math.tan(math.radians(1.0)))
    assert lab.room.start.pose == pytest.approx((-2.0, 0.1, math.radians(2.0)))
    assert lab.drones == (LabDrone(uri="udp://127.0.0.1:19850?time=shm", vehicle="crazyflie21-upgraded"),)
    assert lab.mocap_uri(lab.drones[0]) == "vicon://127.0.0.1:18801?subject=cf1"
    assert lab.mocap.subject_to_body.quaternion == (0.0, 0.0, 0.0, 1.0)
    assert lab.file == str(file)


def test_a_drone_may_have_a_subject_and_a_mark_of_its_own(file: Path) -> None:
    file.write_text(
        LAB + '[[drones]]\nuri = "usb://0"\nvehicle = "v"\nsubject = "cf 2"\nstart = { x = 0, y = 1 }\n'
    )
    lab = read_lab_file(file, RULES)
    second = lab.drone("usb://0")
    assert lab.mocap_uri(second) == "vicon://127.0.0.1:18801?subject=cf%202"
    assert lab.start(second).pose == (0.0, 1.0, 0.0)
    assert lab.start(lab.drones[0]) == lab.room.start
    assert lab.drone("usb://1") is None


def test_the_subject_may_stand_in_the_uri(file: Path) -> None:
    file.write_text(LAB.replace('18801"', '18801?subject=cf%201&rate=2"').replace('subject = "cf1"\n', ""))
    mocap = read_lab_file(file, RULES).mocap
    assert (mocap.uri, mocap.subject) == ("vicon://127.0.0.1:18801?rate=2", "cf 1")


texts = st.text(min_size=1).filter(str.strip)


def quantities(
    unit: str, values: st.SearchStrategy[float], sigma: float = 1e3
) -> st.SearchStrategy[Quantity]:
    measured = st.builds(Quantity, values, st.just(unit), st.floats(0.0, sigma), texts)
    return st.one_of(values.map(lambda value: plain(value, unit)), measured)


marks = st.builds(
    StartMark,
    x=quantities("m", st.floats(-1, 1), 0.1),
    y=quantities("m", st.floats(-1, 1), 0.1),
    yaw_deg=quantities("deg", st.floats(-360, 360)),
)
tilts = quantities("deg", st.floats(-2.8, 2.8), 1.0)
rooms = st.builds(
    LabRoom,
    x_min=quantities("m", st.floats(-3, -1.5), 0.1),
    x_max=quantities("m", st.floats(1.5, 3), 0.1),
    y_min=quantities("m", st.floats(-3, -1.5), 0.1),
    y_max=quantities("m", st.floats(1.5, 3), 0.1),
    floor=quantities("m", st.floats(-0.1, 0.1), 0.02),
    ceiling=st.builds(
        Ceiling, height=quantities("m", st.floats(1.0, 4.0), 0.02), tilt_x_deg=tilts, tilt_y_deg=tilts
    ),
    start=marks,
)
drones = st.lists(
    st.builds(
        LabDrone,
        uri=texts,
        vehicle=texts,
        legs=st.none() | texts,
        policy=st.none() | texts,
        subject=st.none() | texts,
        start=st.none() | marks,
        own_law=st.booleans(),
    ),
    min_size=1,
    max_size=3,
    unique_by=lambda drone: drone.uri,
).map(tuple)


@st.composite
def rotations(draw: st.DrawFn) -> tuple[float, float, float, float]:
    q = draw(st.tuples(*[st.floats(-1.0, 1.0)] * 4).filter(lambda q: math.hypot(*q) > 0.1))
    x, y, z, w = (part / math.hypot(*q) for part in q)
    return x, y, z, w


labs = st.builds(
    LabFile,
    room=rooms,
    drones=drones,
    mocap=st.builds(
        LabMocap,
        uri=texts.filter(lambda uri: "?" not in uri),
        subject=texts,
        subject_to_body=st.builds(
            SubjectToBody,
            position=st.tuples(*[quantities("m", st.floats(-0.15, 0.15), 0.01)] * 3),
            quaternion=rotations(),
        ),
        latency_s=quantities("s", st.floats(0.0, 0.035), 0.035),
    ),
    limits=st.dictionaries(st.just("battery_at_rest"), quantities("V", st.floats(3.8, 4.1)), max_size=1),
)


@given(labs)
def test_what_is_written_reads_back_equal(tmp_path_factory: pytest.TempPathFactory, lab: LabFile) -> None:
    path = tmp_path_factory.mktemp("labs") / "lab.toml"
    write_lab_file(path, lab, comment="two\nlines")
    assert read_lab_file(path, RULES) == lab
    assert drone_addresses(path).uris == [drone.uri for drone in lab.drones]
    assert list(path.parent.iterdir()) == [path]


def test_a_place_that_cannot_be_written_is_named(file: Path, tmp_path: Path) -> None:
    lab = read_lab_file(file, RULES)
    with pytest.raises(LabFileError, match=r"missing/lab\.toml: cannot be written"):
        write_lab_file(tmp_path / "missing" / "lab.toml", lab)


@given(texts.filter(lambda uri: "?" not in uri), texts, st.booleans())
def test_a_subject_put_into_a_uri_comes_out_again(address: str, subject: str, other: bool) -> None:
    address = f"{address}?rate=2" if other else address
    assert split_subject(with_subject(address, subject)) == (address, subject)
    assert with_subject(with_subject(address, "another"), subject) == with_subject(address, subject)


@pytest.mark.parametrize(
    ("old", "new", "key", "remedy"),
    [
        ('schema = "perchhw.lab/1"', "", "schema", 'is missing; a file of this kind says "perchhw.lab/1"'),
        ("x_min = -3.0", "", "room.x_min", "is missing; add x_min"),
        ("x_min = -3.0", "x_mim = -3.0", "room.x_mim", "did you mean 'x_min'"),
        ("x_min = -3.0", "x_min = '3 m'", "room.x_min", "must be a number in m or a table"),
        ("x_min = -3.0", "x_min = true", "room.x_min", "must be a number in m"),
        ("x_min = -3.0", "x_min = nan", "room.x_min.value", "finite"),
        ("x_min = -3.0", "x_min = 2.0", "room.x_min", "must be less than x_max"),
        ("y_max = 1.2", "y_max = -1.0", "room.y_min", "must be less than y_max"),
        ('unit = "cm"', 'unit = "kg"', "room.x_max.unit", "give a unit like 'm'"),
        (', source = "tape measure, 2025-03-04"', "", "room.x_max.source", "is missing"),
        ("x_min = -3.0", "x_min = -3.0\nfloor = -0.2", "room.floor", "put the origin"),
        ("height = 2.4", "height = -0.1", "room.ceiling.height", "must be 1 to 4 m"),
        ("height = 2.4, ", "", "room.ceiling.height", "is missing"),
        ("tilt_x_deg", "tilt_x", "room.ceiling.tilt_x", "did you mean"),
        ("start = { x = -2.0, y = 0.1, yaw_deg = 2 }", "", "room.start", "is missing"),
        ("x = -2.0", "x = -3.5", "room.start", "outside the walls"),
        ("[room]", "[rooms]", "rooms", "did you mean 'room'"),
        ("[room]", "[rooms]", "room", "is missing"),
        ("[[drones]]", "[drones]", "drones", "add [[drones]]"),
        ('uri = "udp://127.0.0.1:19850?time=shm"', "", "drones[0].uri", "is missing"),
        ('vehicle = "crazyflie21-upgraded"', "vehicle = 3", "drones[0].vehicle", "must be text"),
        (
            'vehicle = "crazyflie21-upgraded"',
            'vehicle = "v"\nown_law = 1',
            "drones[0].own_law",
            "true or false",
        ),
        ('vehicle = "crazyflie21-upgraded"', 'vehicle = "v"\nleg = "x"', "drones[0].leg", "'legs'"),
        (
            'vehicle = "crazyflie21-upgraded"',
            'vehicle = "v"\nstart = { x = 9, y = 0 }',
            "drones[0].start",
            "outside the walls",
        ),
        (
            "[mocap]",
            '[[drones]]\nuri = "udp://127.0.0.1:19850?time=shm"\nvehicle = "v"\n[mocap]',
            "drones",
            "twice",
        ),
        ("[mocap]", "[moccap]", "mocap", "is missing"),
        ('subject = "cf1"', "", "mocap.subject", "is missing"),
        ('subject = "cf1"', 'subject = ""', "mocap.subject", "not empty"),
        ('18801"', '18801?subject=cf2"', "mocap.subject", "mocap.uri asks for 'cf2'"),
        ('subject = "cf1"', 'subject = "cf1"\nlatency_s = -0.1', "mocap.latency_s", "must be 0 to"),
        ('subject = "cf1"', 'subject = "cf1"\nlatency = 0.1', "mocap.latency", "did you mean 'latency_s'"),
        (
            'subject = "cf1"',
            'subject = "cf1"\nsubject_to_body = { position = [0, 0] }',
            "mocap.subject_to_body.position",
            "a list of 3 numbers",
        ),
        (
            'subject = "cf1"',
            'subject = "cf1"\nsubject_to_body = { position = [0, 0, "up"] }',
            "mocap.subject_to_body.position[2]",
            "must be a number in m",
        ),
        (
            'subject = "cf1"',
            'subject = "cf1"\nsubject_to_body = { quaternion = [0, 0, 0, 2] }',
            "mocap.subject_to_body.quaternion",
            "unit length",
        ),
        (
            'subject = "cf1"',
            f'subject = "cf1"\nsubject_to_body = {{ quaternion = [0, 0, 0, 1{"0" * 400}] }}',
            "mocap.subject_to_body.quaternion[3]",
            "finite number",
        ),
        (
            'subject = "cf1"',
            'subject = "cf1"\nsubject_to_body = { attitude = [0, 0, 0, 1] }',
            "mocap.subject_to_body.attitude",
            "known keys",
        ),
        ('subject = "cf1"', 'subject = "cf1"\n[limits]\nbattery = 3', "limits.battery", "did you mean"),
        (
            'subject = "cf1"',
            'subject = "cf1"\n[limits]\nbattery_at_rest = 0',
            "limits.battery_at_rest",
            "must be 3.8 to 4.1 V",
        ),
    ],
)
def test_a_wrong_file_is_named_with_key_and_remedy(
    file: Path, old: str, new: str, key: str, remedy: str
) -> None:
    assert old in LAB
    file.write_text(LAB.replace(old, new, 1))
    with pytest.raises(LabFileError) as caught:
        read_lab_file(file, RULES)
    said = [line for line in str(caught.value).splitlines() if line.startswith(f"{file}: {key}: ")]
    assert any(remedy in line for line in said), str(caught.value)


def test_all_problems_are_told_at_once(file: Path) -> None:
    file.write_text(LAB.replace("x_min = -3.0", "x_min = 'a'").replace('subject = "cf1"', ""))
    with pytest.raises(LabFileError) as caught:
        read_lab_file(file, RULES)
    assert len(str(caught.value).splitlines()) == 2


@pytest.mark.parametrize("content", [b"schema =", b"\xff\xfe"])
def test_a_file_that_is_no_toml_is_named(file: Path, content: bytes) -> None:
    file.write_bytes(content)
    for read in (lambda: read_lab_file(file, RULES), lambda: drone_addresses(file)):
        with pytest.raises(LabFileError, match=r"lab\.toml: is not"):
            read()


def test_a_stop_finds_its_drones_in_a_file_that_is_otherwise_broken(file: Path) -> None:
    file.write_text(LAB.replace("x_min", "x_mim").replace("perchhw.lab/1", "perchhw.lab/9"))
    found = drone_addresses(file)
    assert found.uris == ["udp://127.0.0.1:19850?time=shm"]
    assert "perchhw.lab/9" in found.doubt  # a newer one may name drones elsewhere, too
    file.write_text(f"x = {'9' * 5000}\n{LAB}")  # more digits than Python reads
    found = drone_addresses(file)
    assert found.uris == ["udp://127.0.0.1:19850?time=shm"]
    assert "5000 digits" in found.doubt
    file.write_text("drones = [3, { uri = 4 }]\n")
    with pytest.raises(LabFileError, match=r"lab\.toml: drones: .*--drone"):
        drone_addresses(file)
