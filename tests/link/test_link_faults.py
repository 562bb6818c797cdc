"""The link over a network that loses, doubles, reorders and delays, and to drones that freeze, vanish or
never were."""

import socket
import threading
import time
import zlib
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from onboard.link import DroneLink, LinkError, LinkLost, LinkTimeout, drone, exchange, reboot
from onboard.link.connection import Connection, connect
from onboard.timebase import WallTime
from tests.link.faulty_network import Faults, FaultyNetwork
from tests.link.tiny_drone import MEMORY_TYPE, TinyDrone
from tests.patience import PATIENCE_S, StandingClock, patient_link, patient_uri, until

BUNDLE = bytes(np.random.default_rng(1).integers(0, 256, 5120, dtype=np.uint8))
BAD_NETWORKS = {
    "loss": Faults(loss=0.05),
    "duplicates": Faults(duplicate=0.05),
    "reordering": Faults(reorder=0.1),
    "delay": Faults(delay=0.005),
    "everything": Faults(loss=0.05, duplicate=0.05, reorder=0.05, delay=0.0005),
}


@pytest.fixture(params=list(BAD_NETWORKS))
def network(request: pytest.FixtureRequest, tiny: TinyDrone) -> Iterator[FaultyNetwork]:
    """A bad network in front of the tiny drone."""
    with FaultyNetwork(tiny.port, np.random.default_rng(7), BAD_NETWORKS[request.param]) as proxy:
        yield proxy


def reads(link: DroneLink, name: str, value: float) -> bool:
    """Whether the parameter has this value."""
    return link.param(name) == value


def test_bad_network_costs_time_only(network: FaultyNetwork, tiny: TinyDrone) -> None:
    """Connecting, parameters and an upload complete and are right."""
    bundle = BUNDLE if network.faults.delay < 0.002 else BUNDLE[:1200]
    with patient_link(network.uri) as link:
        for step in range(8):
            link.set_param("motion.offset", step)
            assert tiny.values["motion.offset"] == step
            # A second copy of the last answer may come first; nobody can tell it from this one.
            until(partial(reads, link, "motion.offset", step))
        assert link.upload_policy(bundle) == zlib.crc32(bundle)
        assert link.read_memory(MEMORY_TYPE, 0, len(bundle)) == bundle
        assert link.lost is None
    if network.faults.loss:
        assert network.lost
    if network.faults.duplicate:
        assert network.doubled
    if network.faults.reorder:
        assert network.reordered


def test_frozen_drone_is_lost_after_a_second_and_every_blocked_call_returns(tiny: TinyDrone) -> None:
    clock = StandingClock()
    with patient_link(tiny.uri, silence_s=1.0, clock=WallTime(clock)) as link:
        calls: list[Callable[[], object]] = [
            link.supervisor_info,
            lambda: link.param("ring.solid"),
            lambda: link.set_param("ring.solid", 1.0),
            lambda: link.upload_policy(BUNDLE),
            lambda: link.read_memory(MEMORY_TYPE, 0, 100),
            lambda: link.takeoff(0.5, 1.0),
            link.arm,
            lambda: link.stream(["pm.vbatMV"], 100, lambda _sample: None),
        ]
        outcomes: list[BaseException | None] = []
        tiny.frozen.set()
        before = len(tiny.requests)

        def attempt(call: Callable[[], object]) -> None:
            try:
                call()
            except LinkError as error:
                outcomes.append(error)
            else:
                outcomes.append(None)

        threads = [threading.Thread(target=attempt, args=(call,)) for call in calls]
        for thread in threads:
            thread.start()
        asked = {0x90, 0x21, 0x22, 0x41, 0x80, 0x91, 0x51}
        until(lambda: asked <= {request[0] & 0xF3 for request in tiny.requests[before:]})
        clock.now = 0.95
        threading.Event().wait(0.1)
        assert outcomes == []
        clock.now = 1.05
        for thread in threads:
            thread.join(PATIENCE_S)
        assert len(outcomes) == len(calls), "a call is still blocked"
        assert all(isinstance(error, LinkLost) for error in outcomes), outcomes
        assert link.lost is not None
        assert link.silence() > 0.9
        with pytest.raises(LinkLost):
            link.send_pose((0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0))


def test_frozen_drone_is_noticed_without_any_call(tiny: TinyDrone) -> None:
    clock = StandingClock()
    with patient_link(tiny.uri, silence_s=0.3, clock=WallTime(clock)) as link:
        tiny.frozen.set()
        before = len(tiny.requests)
        until(lambda: len(tiny.requests) > before)  # the link pings
        clock.now = 0.31
        until(lambda: link.lost)
        assert "no packet" in str(link.lost)


def test_short_freeze_is_survived(tiny: TinyDrone) -> None:
    clock = StandingClock()
    with patient_link(tiny.uri, silence_s=1.0, clock=WallTime(clock)) as link:
        tiny.frozen.set()
        values: list[float] = []
        asking = threading.Thread(target=lambda: values.append(link.param("ring.solid")))
        before = tiny.count(0x21)
        asking.start()
        until(lambda: tiny.count(0x21) > before)
        tiny.frozen.clear()
        clock.now = 0.9  # the time at which it is asked again
        asking.join(PATIENCE_S)
        assert values == [0.25]
        assert link.lost is None


def test_process_that_dies_is_noticed_before_any_deadline(tiny: TinyDrone) -> None:
    with (
        FaultyNetwork(tiny.port, np.random.default_rng(3), Faults()) as network,
        patient_link(network.uri) as link,
    ):
        network.die()
        with pytest.raises(LinkLost, match="refused"):
            link.param("ring.solid")


def test_nobody_listening_is_a_clear_error_before_any_deadline() -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as unused:
        unused.bind(("127.0.0.1", 0))
        uri = f"udp://127.0.0.1:{unused.getsockname()[1]}"
    with pytest.raises(LinkError, match="no drone at") as caught:
        DroneLink.open(uri, timeout_s=PATIENCE_S)
    assert uri in str(caught.value)
    assert not isinstance(caught.value, LinkTimeout)


def test_silent_listener_is_a_timeout_at_the_deadline(tiny: TinyDrone) -> None:
    tiny.frozen.set()
    start = time.monotonic()
    with pytest.raises(LinkTimeout, match="did not answer"):
        DroneLink.open(tiny.uri, timeout_s=0.7)
    assert 0.7 <= time.monotonic() - start < 8.0, "10 s are the deadline when none is given"


@pytest.mark.parametrize("header", [0xF1, 0xD1, 0x50, 0x51, 0x40, 0x20])
def test_drone_that_stops_answering_while_connecting(tiny: TinyDrone, header: int) -> None:
    """Alive but silent on one subject: only the deadline can end this."""
    tiny.drop = lambda request: request[0] & 0xF3 == header
    start = time.monotonic()
    with pytest.raises(LinkError):
        DroneLink.open(tiny.uri, timeout_s=0.8)
    assert time.monotonic() - start < 8.0, "10 s are the deadline when none is given"


BAD_ENOUGH = {
    "a fifth is lost": Faults(loss=0.2),
    "jitter of 50 ms": Faults(jitter=0.05),
    "4 ms each way": Faults(delay=0.004),
    "30 ms each way": Faults(delay=0.03),
}


@pytest.mark.parametrize("faults", BAD_ENOUGH.values(), ids=list(BAD_ENOUGH))
def test_connects_over_slow_and_lossy_networks(tiny: TinyDrone, tmp_path: Path, faults: Faults) -> None:
    with (
        FaultyNetwork(tiny.port, np.random.default_rng(7), faults) as network,
        DroneLink.open(patient_uri(network.uri), toc_cache=tmp_path) as link,
    ):
        assert link.has_param("ring.solid")
        assert link.has_log("pm.vbatMV")


def test_a_link_that_breaks_after_the_last_answer_is_lost(
    tiny: TinyDrone, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Before anybody could ask for a stop through it."""

    def connect_and_break(*arguments: Any, **options: Any) -> Connection:
        made = connect(*arguments, **options)
        made.crazyflie._link_error_cb("as if it had vanished")
        until(lambda: made.crazyflie.link is None)
        return made

    monkeypatch.setattr(drone, "connect", connect_and_break)
    with pytest.raises(LinkLost, match="while it was set up: as if it had vanished"):
        patient_link(tiny.uri)


def test_a_connection_that_comes_too_late_says_how_to_wait_longer(tiny: TinyDrone) -> None:
    tiny.drop = lambda request: tiny.count(0x40) > 1  # from the details of the memories on
    with pytest.raises(LinkTimeout, match="connect_s=SECONDS"):
        DroneLink.open(patient_uri(tiny.uri) + "&connect_s=0.5")


def test_drone_that_freezes_while_connecting_is_lost(tiny: TinyDrone) -> None:
    tiny.drop = lambda request: tiny.count(0x40) > 1  # from the details of the memories on
    with pytest.raises(LinkLost, match="while it was set up"):
        DroneLink.open(tiny.uri + "?silence_s=0.3", timeout_s=PATIENCE_S)


@pytest.mark.parametrize("uri", ["udp://nowhere", "ftp://127.0.0.1:1", "udp://host.invalid:19850"])
def test_unusable_uris_say_so(uri: str) -> None:
    address = uri.split("/")[2].split(":")[0]
    with pytest.raises(LinkError, match=address):
        DroneLink.open(uri, timeout_s=PATIENCE_S)
    with pytest.raises(LinkError, match=address):
        reboot(uri, timeout_s=1.0)


def test_a_write_is_repeated_as_often_as_it_is_told(
    tiny: TinyDrone, link: DroneLink, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Who must be heard soon does not wait for the link's own repetition, which here never comes."""
    monkeypatch.setattr(exchange, "RETRY_S", 1e6)
    writes = []

    def lose_three(request: bytes) -> bool:
        is_write = request[0] & 0xF3 == 0x22
        writes.extend([request] * is_write)
        return is_write and len(writes) <= 3

    tiny.drop = lose_three
    link.set_param("motion.offset", 5, retry_s=0.01)
    assert tiny.values["motion.offset"] == 5
    assert len(writes) > 3
