"""A served firmware with nothing behind it, and a client that sends raw packets to it."""

from collections.abc import Iterator

import pytest

from tests.sim_crazyflie.minimal_firmware import MinimalFirmware, RawClient, ServedFirmware, serve


@pytest.fixture
def drone() -> Iterator[ServedFirmware]:
    with serve(MinimalFirmware()) as served:
        yield served


@pytest.fixture
def client(drone: ServedFirmware) -> Iterator[RawClient]:
    with RawClient(drone.uri) as raw:
        yield raw
