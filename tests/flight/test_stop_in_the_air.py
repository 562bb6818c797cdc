"""A sample of the stop proof, and that its drone is locked by nothing but stop packets."""

from collections.abc import Iterator

import numpy as np
import pytest

from perchhw.lab_process import SimulatedLab
from tests.flight.airborne import Airborne, when_it_flies
from tests.flight.stop_proof import WAYS, stop_when_it_flies

FREE_PORTS = ("--drone-port", "0", "--vicon-port", "0", "--vicon-udp-port", "0", "--seed", "7")
SEED = 2026


@pytest.fixture(scope="module")
def lab() -> Iterator[SimulatedLab]:
    """At real pace: a stop does not know the time of a lab."""
    with SimulatedLab("lab", FREE_PORTS) as lab:
        yield lab


@pytest.fixture(scope="module")
def air(lab: SimulatedLab, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Airborne]:
    """A host for its drone, which flies again and again as in the proof."""
    folder = tmp_path_factory.mktemp("air")
    with Airborne(lab.drones[0], lab.mocap[0], folder, np.random.default_rng(SEED)) as air:
        yield air


@pytest.mark.parametrize("number", range(len(WAYS)))
def test_a_stop_packet_of_the_host_locks_the_drone(air: Airborne, lab: SimulatedLab, number: int) -> None:
    stop = stop_when_it_flies(air, lab.drones[0], number, SEED)
    assert stop.way == WAYS[number % len(WAYS)]
    assert stop.locked_by_packet
    assert stop.confirmed


@pytest.mark.soak  # of which continuous integration runs a sample
def test_without_its_packets_nothing_stops_the_drone_and_the_operator_is_told(air: Airborne) -> None:
    """What the proof rests on: neither watchdog nor closing setpoint is left."""
    air.withhold(everything_that_stops=True)
    when_it_flies(lambda: air.take_off("moving to start"))
    air.key()
    air.key()
    ended = air.ended()
    assert len(air.attempted) > 50
    assert not air.stops
    assert "NOT CONFIRMED" in str(ended["alert"])
    assert not air.witness.bits().is_locked
