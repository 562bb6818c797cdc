"""pytest plugin of perchhw: simulated Crazyflies and mocap rooms as fixtures for any project.

Installed with perchhw; a test only names the fixture:

>>> def test_battery(crazyflie):                                    # doctest: +SKIP
...     assert crazyflie.param.get_value("stabilizer.estimator")

``pytest --crazyflie-uri radio://0/80/2M/E7E7E7E7E7`` runs the same tests on hardware. Nothing but this module
is loaded, and no process started, before a test asks for a fixture.
"""

from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

if TYPE_CHECKING:
    from cflib.crazyflie import Crazyflie

    from onboard.link import DroneLink
    from perchhw.lab_process import SimulatedLab
    from perchhw.testing import Lab, SimulatedDrone, StageProcess
    from perchhw.testing.instant import InstantLab

_CONNECT_TIMEOUT_S = 60.0
_CLOSE_TIMEOUT_S = 2.0
_ROOM_PORTS = ("--vicon-port", "0", "--vicon-udp-port", "0")
_MARKER = "crazyflie"
_OPTIONS = frozenset({"drones", "vehicle", "legs", "seed", "poses", "room", "faults", "flies"})


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add ``--crazyflie-uri`` and ``--crazyflie-records``."""
    group = parser.getgroup("perchhw", "Crazyflie")
    group.addoption(
        "--crazyflie-uri",
        metavar="URI",
        default=None,
        help="run the tests that use a Crazyflie on this one instead of a simulated one (radio://..., usb://, udp://...)",
    )
    group.addoption(
        "--crazyflie-records",
        metavar="DIR",
        default=None,
        help="folder for the records of tests that failed in a simulated lab (default: crazyflie-records)",
    )


def pytest_configure(config: pytest.Config) -> None:
    """Register the marker."""
    config.addinivalue_line(
        "markers",
        f"{_MARKER}(drones=1, vehicle=..., legs=..., seed=0, poses=True, room=False, faults=(), flies=True): "
        "what the fixtures lab, drone and drones give",
    )


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item: pytest.Item, call: pytest.CallInfo[None]) -> Any:
    """Say in the report of a test that failed where its lab's record is."""
    report = yield
    recorded = item.stash.get(_RECORDED, None)
    if recorded is not None and report.failed:
        place = item.stash[_FAILED] = _record_of(item)
        report.sections.append(("simulated lab", f"record: {place}"))
        if report.when == "teardown":  # the lab is closed already
            _keep_record(item, recorded)
    return report


_RECORDED = pytest.StashKey[Path]()
"""What the lab of a test records."""
_FAILED = pytest.StashKey[Path]()
"""Where the record of a test that failed is kept."""


def _record_of(item: pytest.Item) -> Path:
    root = item.config.getoption("--crazyflie-records")
    name = "".join(c if c.isalnum() or c in "-_." else "_" for c in item.nodeid)
    return (Path(root) if root else item.config.rootpath / "crazyflie-records") / name[-120:]


@pytest.fixture(scope="session")
def _stages() -> Iterator[dict[bool, "StageProcess"]]:
    """The processes that serve labs, by whether their drones are parked; started when first needed."""
    stages: dict[bool, StageProcess] = {}
    yield stages
    for stage in stages.values():
        stage.close()


@pytest.fixture
def lab(
    request: pytest.FixtureRequest, _stages: dict[bool, "StageProcess"], tmp_path: Path
) -> Iterator["Lab"]:
    """A fresh simulated lab for this test, in real time: ``drones``, faults of its poses, its time.

    ``@pytest.mark.crazyflie(drones=3, seed=7, ...)`` says what it has.
    """
    from perchhw.testing import Lab, StageProcess

    options = _options(request.node)
    parked = not options.pop("flies", True)
    if parked and options.get("room"):
        raise pytest.UsageError(
            f"{request.node.nodeid}: a room sees drones that fly: leave room=True or flies=False out"
        )
    if parked in _stages and not _stages[parked].alive:
        _stages.pop(parked).close()
    if parked not in _stages:
        _stages[parked] = StageProcess(parked).open()
    lab = Lab(_stages[parked], tmp_path / "lab", **options)
    request.node.stash[_RECORDED] = lab.folder
    with ExitStack() as stack:
        stack.callback(_keep_record, request.node, lab.folder)
        stack.callback(lab.close)
        yield lab


def _keep_record(item: pytest.Item, recorded: Path) -> None:
    """Keep what was recorded of a test that failed."""
    import shutil

    kept = item.stash.get(_FAILED, None)
    if kept is not None:
        shutil.rmtree(kept, ignore_errors=True)
        shutil.copytree(recorded, kept)


def _options(item: pytest.Item) -> dict[str, Any]:
    options: dict[str, Any] = {}
    for marker in reversed(list(item.iter_markers(_MARKER))):  # the nearest one last
        options.update(marker.kwargs)
        if marker.args:
            raise pytest.UsageError(f"{item.nodeid}: the marker {_MARKER} takes names, such as drones=2")
    unknown = sorted(options.keys() - _OPTIONS)
    if unknown:
        raise pytest.UsageError(
            f"{item.nodeid}: the marker {_MARKER} knows no {unknown[0]!r}, but {', '.join(sorted(_OPTIONS))}"
        )
    return options


@pytest.fixture
def instant_lab(
    request: pytest.FixtureRequest, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> Iterator["InstantLab"]:
    """A fresh lab in this process, for cflib: time stands still but for packets and ``run_for``, and
    ``time.sleep`` and ``SyncLogger`` on the main thread let the lab's time pass."""
    import time

    from cflib.crazyflie.syncLogger import SyncLogger

    from perchhw.testing.instant import InstantLab

    options = _options(request.node)
    options.pop("flies", None)  # where nothing flies an instant lab is as fast
    if options.pop("room", False):
        raise pytest.UsageError(
            f"{request.node.nodeid}: an instant lab has no room: take the fixture lab with room=True"
        )
    lab = InstantLab(tmp_path / "instant-lab", **options)
    request.node.stash[_RECORDED] = lab.folder
    take = SyncLogger.__next__

    def next_sample(logger: SyncLogger) -> Any:
        lab.pass_until_logged(logger)
        return take(logger)

    monkeypatch.setattr(time, "sleep", lab.sleep)
    monkeypatch.setattr(SyncLogger, "__next__", next_sample)
    yield lab
    lab.close()
    _keep_record(request.node, lab.folder)


@pytest.fixture
def drone(lab: "Lab") -> "SimulatedDrone":
    """The first drone of a fresh simulated lab: its ``uri``, the truth about it, faults."""
    return lab.drones[0]


@pytest.fixture
def drones(lab: "Lab") -> list["SimulatedDrone"]:
    """All drones of a fresh simulated lab."""
    return lab.drones


@pytest.fixture(scope="session")
def crazyflie_uri(request: pytest.FixtureRequest) -> Iterator[str]:
    """Address of one Crazyflie for the whole session: that of ``--crazyflie-uri``, else a simulated one.

    The simulated drone is a process of its own, on a free UDP port, with the tables of the real firmware. It
    keeps its parameters between tests, as a real one does.
    """
    uri = request.config.getoption("--crazyflie-uri")
    if uri is not None:
        yield uri
        return
    from perchhw.lab_process import SimulatedLab

    with SimulatedLab("drone", ("--drone-port", "0")) as served:
        yield served.drones[0]


@pytest.fixture(scope="session")
def simulated_lab() -> Iterator["SimulatedLab"]:
    """A whole simulated lab for the session: ``drones`` and ``mocap`` are the URIs; the room sees the
    drones."""
    from perchhw.lab_process import SimulatedLab

    with SimulatedLab("lab", ("--drone-port", "0", *_ROOM_PORTS)) as served:
        yield served


@pytest.fixture(scope="session")
def simulated_room() -> Iterator["SimulatedLab"]:
    """A simulated mocap room for the session: ``mocap`` are its URIs."""
    from perchhw.lab_process import SimulatedLab

    with SimulatedLab("room", _ROOM_PORTS) as served:
        yield served


@pytest.fixture
def crazyflie(crazyflie_uri: str) -> Iterator["Crazyflie"]:
    """A cflib ``Crazyflie``, fully connected (every parameter has its value); closed after the test.

    Over ``udp://`` it uses perchhw's driver, so a test fails with a timeout where cflib alone would wait for
    ever.
    """
    from onboard.link.crazyflie import open_crazyflie
    from onboard.timebase import WALL

    connected = open_crazyflie(crazyflie_uri, timeout_s=_CONNECT_TIMEOUT_S, clock=WALL)
    yield connected
    connected.close_within(_CLOSE_TIMEOUT_S)


@pytest.fixture
def drone_link(crazyflie_uri: str) -> Iterator["DroneLink"]:
    """A :class:`onboard.link.DroneLink`, the flight stack's own connection; closed after the test."""
    from onboard.link import DroneLink

    with DroneLink.open(crazyflie_uri, timeout_s=_CONNECT_TIMEOUT_S) as link:
        yield link
