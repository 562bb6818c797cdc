"""A served firmware with nothing behind it, and a client that sends raw packets to it; either engine."""

from collections.abc import Iterator

import pytest

from onboard.firmware.compiler import find_compiler
from sim_backend.crazyflie import firmware
from sim_backend.engine_name import EngineName
from tests.firmware.shell_engine import ShellEngine
from tests.sim_crazyflie.minimal_firmware import MinimalFirmware, RawClient, ServedFirmware, serve
from tests.sim_crazyflie.simulated_flight import ENGINES, Flight


@pytest.fixture
def drone() -> Iterator[ServedFirmware]:
    with serve(MinimalFirmware()) as served:
        yield served


@pytest.fixture
def client(drone: ServedFirmware) -> Iterator[RawClient]:
    with RawClient(drone.uri) as raw:
        yield raw


@pytest.fixture(params=ENGINES)
def either_engine(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> EngineName:
    """What drones run in this test: the drone's own code, with its shell and without, and its reference."""
    engine = EngineName.REFERENCE if request.param == EngineName.REFERENCE else EngineName.C
    if engine is EngineName.C and find_compiler() is None:
        pytest.skip("no C compiler: the drone's code in C cannot fly")
    if request.param == "shell":
        monkeypatch.setattr(firmware, "make_engine", lambda _, vehicle: ShellEngine(vehicle))
    monkeypatch.setattr(Flight, "engine", engine)
    return engine
