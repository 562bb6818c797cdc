"""The drone's recorder over a socket: read when it has stopped, never written."""

import numpy as np
import pytest

from onboard.app_interface import MEMORY_SIZE, MEMORY_TYPE_APP, RECORD_ADDRESS, Parameter
from onboard.link import CommandRefused
from onboard.link.recorder import read_ring
from onboard.ring import RING_BYTES, RingError, decode_ring
from tests.patience import patient_link
from tests.rehearsal.desk import Desk
from tests.sim_crazyflie.served_flight import serve_flight


def test_it_comes_as_it_lies_on_the_drone() -> None:
    desk = Desk()
    wanted = desk.rehearse()
    with serve_flight(desk.flight) as served, patient_link(served.uri) as link:
        ring = read_ring(link)
    assert np.array_equal(ring.ticks, wanted.ticks)
    assert ring.end_tick == wanted.end_tick
    assert ring.periods.tobytes() == wanted.periods.tobytes()


def test_a_recording_shorter_than_the_ring_comes_alone() -> None:
    desk = Desk()
    desk.arm()
    desk.flight.write(Parameter.REHEARSE, 0)
    desk.flight.run(0.4)
    with serve_flight(desk.flight) as served, patient_link(served.uri) as link:
        ring = read_ring(link)
    assert 30 <= len(ring.ticks) < 40
    assert ring.periods.tobytes() == decode_ring(desk.flight.firmware.engine.record()).periods.tobytes()


def test_nothing_is_read_before_an_approach_was_armed() -> None:
    with (
        serve_flight(Desk().flight) as served,
        patient_link(served.uri) as link,
        pytest.raises(RingError, match="no approach was armed"),
    ):
        read_ring(link, within=0.05)


def test_nothing_is_read_while_it_records() -> None:
    desk = Desk()
    desk.arm()
    with (
        serve_flight(desk.flight) as served,
        patient_link(served.uri) as link,
        pytest.raises(RingError, match="it records still"),
    ):
        read_ring(link, within=0.05)


def test_the_address_map_has_a_gap_and_the_recorder_is_read_only() -> None:
    with serve_flight(Desk().flight) as served, patient_link(served.uri) as link:
        assert len(link.read_memory(MEMORY_TYPE_APP, RECORD_ADDRESS + RING_BYTES - 24, 24)) == 24
        for address in (MEMORY_SIZE - 1, MEMORY_SIZE, RECORD_ADDRESS - 1):
            with pytest.raises(CommandRefused, match="refuses to read"):
                link.read_memory(MEMORY_TYPE_APP, address, 2)
        with pytest.raises(CommandRefused, match="refuses to write"):
            link._memories.write(MEMORY_TYPE_APP, b"\1", RECORD_ADDRESS)
