"""pytest plugin of perchhw: simulated Crazyflies and mocap rooms as fixtures for any project.

Installed with perchhw; a test only names the fixture:

>>> def test_battery(crazyflie):                                    # doctest: +SKIP
...     assert crazyflie.param.get_value("stabilizer.estimator")

``pytest --crazyflie-uri radio://0/80/2M/E7E7E7E7E7`` runs the same tests on hardware. Nothing but this module
is loaded, and no process started, before a test asks for a fixture.
"""

from collections.abc import Iterator
from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:
    from cflib.crazyflie import Crazyflie

    from onboard.link import DroneLink
    from perchhw.lab_process import SimulatedLab

_CONNECT_TIMEOUT_S = 60.0
_CLOSE_TIMEOUT_S = 2.0
_ROOM_PORTS = ("--vicon-port", "0", "--vicon-udp-port", "0")


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add ``--crazyflie-uri``."""
    group = parser.getgroup("perchhw", "Crazyflie")
    group.addoption(
        "--crazyflie-uri",
        metavar="URI",
        default=None,
        help="run the tests that use a Crazyflie on this one instead of a simulated one (radio://..., usb://, udp://...)",
    )


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
