"""The log blocks of a flight: what they bring, and that a radio carries them."""

import threading

import pytest

from onboard.link import DroneLink
from onboard.link.drone import LogSample
from onboard.record.topics import TOPICS
from perchhw.flight.telemetry import BLOCKS, TEST_FLIGHT_BLOCKS, TelemetryBlock
from tests.patience import PATIENCE_S, patient_link

RADIO_PACKETS = 260
"""A second; Bitcraze's own tests demand 300 log packets a second of the radio."""
FLIGHTS = {"landing": BLOCKS, "test flight": TEST_FLIGHT_BLOCKS}


@pytest.mark.parametrize("blocks", FLIGHTS.values(), ids=list(FLIGHTS))
def test_a_radio_carries_them(blocks: tuple[TelemetryBlock, ...]) -> None:
    assert sum(1000 / block.period_ms for block in blocks) <= RADIO_PACKETS


def test_a_landing_still_brings_every_field_of_the_drones_topics() -> None:
    brought = {(field.topic, field.name) for block in BLOCKS for field in block.variables.values()}
    topics = ("estimate", "rates", "acceleration", "cues", "motors", "power", "trigger")
    wanted = {(topic, field.name) for topic in topics for field in TOPICS[topic].fields}
    wanted -= {(topic, "drone_time_ms") for topic in topics}
    assert wanted | {("supervisor", "bits")} <= brought


@pytest.mark.parametrize("blocks", FLIGHTS.values(), ids=list(FLIGHTS))
def test_the_drone_sends_each_of_them(crazyflie_uri: str, blocks: tuple[TelemetryBlock, ...]) -> None:
    with patient_link(crazyflie_uri) as link:
        for block in blocks:
            halves = {name for name, field in block.variables.items() if field.half}
            sample = one_sample(link, tuple(block.variables), halves)
            assert sample.values.keys() == block.variables.keys()
            whole = {n: one_sample(link, (n,), set()).values[n] for n in halves if n.startswith("acc")}
            for name, value in whole.items():
                assert sample.values[name] == pytest.approx(value, rel=1e-3, abs=0.05)  # g; noise in between


def one_sample(link: DroneLink, variables: tuple[str, ...], halves: set[str]) -> LogSample:
    """The first that comes."""
    came = threading.Event()
    with link.stream(variables, 10, lambda _sample: came.set(), halves=halves) as stream:
        assert came.wait(PATIENCE_S)
        assert stream.latest is not None
        return stream.latest
