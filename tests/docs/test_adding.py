"""The code on docs/adding.md is taken from the page and run where it would stand."""

import importlib
import json
import math
import os
import re
import socket
import sys
import threading
import tomllib
from dataclasses import replace
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest

from calibration import flight_formats
from calibration.bench.instruments import addresses, schemes
from calibration.bench.instruments.errors import InstrumentInputError
from calibration.flights import FORMATS, open_flight
from mocap_bridge.errors import MocapUriError, PoseTimeout, SourceLost
from mocap_bridge.pose import open_pose_stream
from mocap_bridge.uri import SCHEMES, parse_mocap_uri
from onboard.by_name import imported
from onboard.manoeuvres import library as manoeuvres
from onboard.quantity import Quantity
from onboard.room import RoomGeometry
from onboard.vehicle import EFFECTS, Effect, check_vehicle, load_vehicle, vehicle_to_toml
from onboard.vehicle.effects.tables import described
from perchhw.cli.main import run as run_perchhw
from sim_backend.physics.effects.registry import TERMS
from sim_backend.physics.parameters import physics_parameters
from tests.conftest import REPOSITORY

NOBODY: Any = None
PAGE = (REPOSITORY / "docs" / "adding.md").read_text(encoding="utf-8")


def blocks(heading: str, language: str = "python") -> list[str]:
    """The blocks of code in one section."""
    section = PAGE.split(f"\n## {heading}\n")[1].split("\n## ")[0]
    return re.findall(rf"```{language}\n(.*?)```", section, re.DOTALL)


def module_of(code: str, name: str) -> ModuleType:
    """A new module with this code."""
    module = ModuleType(name)
    exec(compile(code, name, "exec"), module.__dict__)
    return module


def row_of(code: str, table: ModuleType, **names: Any) -> Any:
    """A row of a table, as it would stand in the table's module."""
    return eval(code, {**vars(table), **names})


def test_every_file_that_the_page_names_is_there() -> None:
    """A new module has its folder: whoever added it as the page says has it already."""
    text = re.sub(r"^```.*?^```", "", PAGE, flags=re.DOTALL | re.MULTILINE)
    named = re.findall(r"`([\w./]+(?:\.py|\.toml|/))`(, a new module)?", text)
    assert len(named) >= 15
    for file, new in named:
        assert (REPOSITORY / file).exists() or (new and (REPOSITORY / file).parent.is_dir()), file


def test_an_effect(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    (table,), (equation,) = blocks("An effect", "toml"), blocks("An effect")
    (description,) = described(tomllib.loads(table), "adding.md").values()
    term = module_of(equation, "sim_backend.physics.effects.propeller_guard").EFFECT
    monkeypatch.setitem(EFFECTS, description.name, description)
    monkeypatch.setitem(TERMS, term.name, term)
    guard = Effect(
        name="propeller_guard",
        parameters={
            "mass": Quantity(0.003, "kg", 0.0, "test case"),
            "radius": Quantity(0.07, "m", 0.0, "test case"),
        },
    )
    bare = load_vehicle("crazyflie21-upgraded")
    file = tmp_path / "guarded.toml"
    file.write_text(vehicle_to_toml(replace(bare, effects=(guard,))), encoding="utf-8")
    assert check_vehicle(file) == []
    room = RoomGeometry()
    plain, ringed = (physics_parameters(vehicle, room) for vehicle in (bare, load_vehicle(file)))
    assert ringed["mass"] - plain["mass"] == pytest.approx(0.003)
    np.testing.assert_allclose(
        ringed["inertia"] - plain["inertia"], 0.003 * 0.07**2 * np.array([0.5, 0.5, 1])
    )
    file.write_text(file.read_text(encoding="utf-8").replace("0.07", "0.7"), encoding="utf-8")
    assert "between 0.03 and 0.2 m" in check_vehicle(file)[0]


@pytest.fixture
def json_udp(monkeypatch: pytest.MonkeyPatch) -> int:
    """The mocap source of the page is known; gives a free port."""
    code, row = blocks("A mocap source")
    uri = importlib.import_module("mocap_bridge.uri")
    scheme = row_of(row, uri)
    name = scheme.opener.rpartition(".")[0]
    monkeypatch.setitem(sys.modules, name, module_of(code, name))
    monkeypatch.setitem(SCHEMES, "json-udp", scheme)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as free:
        free.bind(("127.0.0.1", 0))
        return free.getsockname()[1]


def send(port: int, *datagrams: object) -> threading.Event:
    """Send them over and over until the event is set."""
    stop = threading.Event()

    def repeat() -> None:
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
            while not stop.wait(0.005):
                for datagram in datagrams:
                    sender.sendto(json.dumps(datagram).encode(), ("127.0.0.1", port))

    threading.Thread(target=repeat, daemon=True).start()
    return stop


def test_a_mocap_source(json_udp: int) -> None:
    pose = [0.1, 0.2, 1.5, 0.0, 0.0, 0.0, 1.0]
    others = (
        ["foreign"],
        "foreign",
        {"frame": 1, "cf1": ["a", 0, 1, 0, 0, 0, 1]},
        {"frame": 1, "cf1": [0, 0, 1]},
        {"frame": 1, "cf1": [math.nan, 0, 1, 0, 0, 0, 1]},
        {"frame": 1, "cf1": [10**400, 0, 1, 0, 0, 0, 1]},
        {"frame": 1, "cf1": 1},
        {"frame": math.inf, "cf1": pose},
        {"frame": "first", "cf1": pose},
        {"cf1": pose},
    )
    stop = send(json_udp, {"frame": 7, "cf1": pose}, {"frame": 8}, *others)
    try:
        with open_pose_stream(f"json-udp://:{json_udp}?subject=cf1") as stream:
            by_frame = {}
            while by_frame.keys() != {7, 8} or stream.statistics().refused <= len(others):
                sample = stream.read(60.0)
                by_frame[sample.frame] = sample
    finally:
        stop.set()
    assert by_frame.keys() == {7, 8}
    assert by_frame[7].position == (0.1, 0.2, 1.5)
    assert by_frame[7].quaternion == (0.0, 0.0, 0.0, 1.0)
    assert by_frame[8].occluded
    assert by_frame[8].position is None


def test_a_mocap_source_that_is_silent_or_taken(json_udp: int) -> None:
    assert parse_mocap_uri("json-udp://?subject=cf1").port == 4000
    with pytest.raises(PoseTimeout, match="no frame"):
        open_pose_stream(f"json-udp://:{json_udp}?subject=cf1")
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as taken:
        taken.bind(("127.0.0.1", json_udp))
        with pytest.raises(SourceLost, match="in use"):
            open_pose_stream(f"json-udp://:{json_udp}?subject=cf1")


@pytest.fixture
def another_package(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The module of the page installed as somebody else's package; gives its folder."""
    code, row = blocks("A mocap source")
    named = row.replace("mocap_bridge.sources.json_udp.", "json_udp.")
    text = f"{code}\n\nfrom mocap_bridge.uri import MocapScheme\n\nSCHEME = {named}"
    (tmp_path / "json_udp.py").write_text(text, encoding="utf-8")
    (points,) = re.findall(r"```toml\n(.*?)```", PAGE.split("\n## A mocap source\n")[1], re.DOTALL)[:1]
    ((group, entries),) = tomllib.loads(points)["project"]["entry-points"].items()
    installed = tmp_path / "their_mocap-1.0.dist-info"
    installed.mkdir()
    (installed / "METADATA").write_text("Metadata-Version: 2.1\nName: their-mocap\nVersion: 1.0\n")
    lines = [f"{name} = {target}" for name, target in entries.items()]
    (installed / "entry_points.txt").write_text("\n".join((f"[{group}]", *lines)))
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.delitem(sys.modules, "json_udp", raising=False)
    monkeypatch.delitem(SCHEMES, "json-udp", raising=False)  # of whoever has the page's row already
    return tmp_path


def test_a_mocap_source_of_another_package(another_package: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    stop = send(port, {"frame": 7, "cf1": [0.1, 0.2, 1.5, 0.0, 0.0, 0.0, 1.0]})
    try:
        run_perchhw(["--json", "mocap", "watch", f"json-udp://:{port}?subject=cf1", "--seconds", "0.5"])
    finally:
        stop.set()
    assert json.loads(capsys.readouterr().out)["last_pose"]["position"] == [0.1, 0.2, 1.5]


def test_a_broken_mocap_package_is_told(another_package: Path) -> None:
    (another_package / "json_udp.py").write_text("SCHEME = 'json'")
    with pytest.raises(MocapUriError, match=r"their-mocap: json_udp:SCHEME is no MocapScheme"):
        parse_mocap_uri("json-udp://?subject=cf1")
    with pytest.raises(MocapUriError, match=r"unknown scheme 'json-tcp'; .*, json-udp://\.\.\."):
        parse_mocap_uri("json-tcp://?subject=cf1")


@pytest.mark.parametrize(
    ("code", "told"),
    [
        ("import a_vendor_sdk", r"ModuleNotFoundError: No module named 'a_vendor_sdk' \(json_udp.py:1\)"),
        ("SCHEM = 1", "AttributeError: .*'SCHEME'"),
        ("def", r"SyntaxError: invalid syntax \(json_udp.py, line 1\)"),
        ("\nraise RuntimeError('no licence')", r"RuntimeError: no licence \(json_udp.py:2\)"),
    ],
)
def test_a_mocap_package_that_breaks_is_told_with_its_place(
    another_package: Path, code: str, told: str
) -> None:
    (another_package / "json_udp.py").write_text(code)
    with pytest.raises(MocapUriError, match=f"their-mocap: the source broke, which is a bug of it: {told}"):
        parse_mocap_uri("json-udp://?subject=cf1")


def test_an_instrument(monkeypatch: pytest.MonkeyPatch) -> None:
    code, row = blocks("An instrument")
    ours, theirs = os.openpty()
    answers = iter((b"2.00 g\r\n", b"12.50 g\r\n", b"overload\r\n", b"nan g\r\n", b"12.5 oz\r\n"))

    def answer() -> None:
        for text in answers:
            asked = b""
            while not asked.endswith(b"P\r\n"):
                asked += os.read(ours, 16)
            os.write(ours, text)

    threading.Thread(target=answer, daemon=True).start()
    module = module_of(code, "printing_scale")
    scheme = row_of(row, schemes)
    monkeypatch.setitem(sys.modules, scheme.opener.rpartition(".")[0], module)
    monkeypatch.setitem(schemes.SCALES, "printing", scheme)
    with addresses.ScaleAddress.of(f"printing://{os.ttyname(theirs)}").open(NOBODY) as scale:
        scale.begin()
        scale.look(0.1)
        scale.look(0.1)
        assert scale.read().indication == pytest.approx(0.00725)
        for refused in ("overload", "nan g", "12.5 oz"):
            with pytest.raises(module.InstrumentRefused, match=refused):
                scale.look(0.1)
        assert scale.read().indication == pytest.approx(0.00725)
    os.close(theirs)
    with pytest.raises(InstrumentInputError, match="printing://"):
        addresses.ScaleAddress.of("kitchen:///dev/ttyUSB0")


def test_a_flight_format(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    code, row = blocks("A flight format")
    module = module_of(code, "calibration.flights.my_lab")
    ((name, place),) = row_of(row, flight_formats).items()
    monkeypatch.setitem(sys.modules, place.rpartition(".")[0], module)
    monkeypatch.setitem(FORMATS, name, imported(place))
    file = tmp_path / "flight.csv"
    file.write_text("time_ms,x_mm,y_mm,z_mm,q0,q1,q2,q3\n0,100,0,1500,1,0,0,0\n10,110,0,1500,1,0,0,0\n")
    flight = open_flight(file)
    assert flight.format == "my_lab"
    assert flight.t[1] == pytest.approx(0.01)
    np.testing.assert_allclose(flight.data["x"], [0.1, 0.11])
    assert flight.data["qw"][0] == 1.0


def test_a_manoeuvre(monkeypatch: pytest.MonkeyPatch) -> None:
    (code,) = blocks("A manoeuvre")
    names = dict(vars(manoeuvres))
    exec(code, names)
    staircase = names["STAIRCASE"]
    monkeypatch.setitem(manoeuvres.MANOEUVRES, staircase.kind, staircase)
    course = manoeuvres.manoeuvre("staircase").course({"rise": 0.25}, RoomGeometry())
    assert course.position[:, 2].max() == pytest.approx(1.1 + 0.75)
    assert course.position[-1] == pytest.approx(course.position[0])
    with pytest.raises(manoeuvres.CourseDoesNotFit, match="staircase"):
        manoeuvres.manoeuvre("staircase").course({"rise": 0.5}, RoomGeometry())


def test_a_vehicle(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    (code,) = blocks("A vehicle")
    monkeypatch.chdir(tmp_path)
    exec(code, {})
    assert check_vehicle("mine.toml") == []
    mine = load_vehicle("mine.toml")
    assert mine.body.mass.value == 0.0402
    assert mine.legs is not None
    assert mine.legs.design == "wide-short"
