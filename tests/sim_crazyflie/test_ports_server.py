"""The server itself: peers, power, silence, reboots, hostile bytes, faults of the link."""

import asyncio
import struct
import time

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from sim_backend.crazyflie.crtp import Packet
from sim_backend.crazyflie.faults import DatagramFaults
from sim_backend.crazyflie.ports.radio import Power
from sim_backend.crazyflie.server import CrazyflieServer, ServerError
from tests.drawn_examples import examples
from tests.patience import PATIENCE_S, until
from tests.sim_crazyflie.minimal_firmware import (
    MinimalFirmware,
    RawClient,
    ServedFirmware,
    SteppedClock,
    serve,
)


def answers(client: RawClient, datagram: bytes, timeout_s: float = 0.2) -> bytes | None:
    """The next datagram of port 15 after a request, or None when the drone is silent."""
    client.socket.send(datagram)
    client.socket.settimeout(timeout_s)
    try:
        while (answer := client.socket.recv(64))[0] >> 4 != 15:
            pass  # console and log data that were on their way
    except TimeoutError:
        return None
    else:
        return answer
    finally:
        client.socket.settimeout(PATIENCE_S)


def test_scan_is_answered_and_does_not_take_over_the_stream(client: RawClient, drone: ServedFirmware) -> None:
    client.exchange(b"\x51\6\1\x77\0\0", b"\x51\3\1\1")
    with RawClient(drone.uri) as scanner:
        assert answers(scanner, b"\xff") == b"\xff"
        first = client.wait_for(5, 2)
        assert client.wait_for(5, 2)[1:4] != first[1:4]
        scanner.socket.settimeout(0.05)
        with pytest.raises(TimeoutError):
            scanner.socket.recv(64)


def test_the_last_client_gets_the_stream(client: RawClient, drone: ServedFirmware) -> None:
    client.exchange(b"\x51\6\1\x77\0\0", b"\x51\3\1\1")
    client.wait_for(5, 2)
    with RawClient(drone.uri) as second:
        second.exchange()
        second.wait_for(5, 2)


def test_port_in_use_says_so(drone: ServedFirmware) -> None:
    async def start() -> None:
        await CrazyflieServer(MinimalFirmware(), *drone.server.address).start()

    with pytest.raises(ServerError, match=str(drone.server.address[1])):
        asyncio.run(start())


def test_address_before_start_is_an_error() -> None:
    server = CrazyflieServer(MinimalFirmware())
    with pytest.raises(ServerError, match="start"):
        _ = server.uri
    server.close()


class TestPower:
    def test_off_and_on(self, client: RawClient, drone: ServedFirmware) -> None:
        client.exchange(b"\x51\6\1\x77\0\0", b"\x51\3\1\1", b"\x91\1\1")
        assert drone.firmware.armed
        assert answers(client, b"\xff\xfe\x02") == b"\xff"
        assert (drone.server.radio.power, drone.firmware.powered) == (Power.RADIO_ONLY, False)
        assert not drone.firmware.armed
        assert answers(client, b"\xff") == b"\xff"
        assert answers(client, b"\xf0echo") is None
        assert answers(client, b"\xff\xfe\x04") == b"\xff\xfe\x04" + struct.pack("<f", 4.0)
        assert answers(client, b"\xff\xfe\x03") == b"\xff"
        assert client.exchange() == []
        assert drone.firmware.boot_count == 2
        assert client.ask(5, 1, b"\3\1\1") == [b"\3\1\2"]  # the block is gone
        assert answers(client, b"\xff\xfe\x03") == b"\xff"
        assert drone.firmware.boot_count == 2  # was on

    def test_all_off_needs_the_button(self, client: RawClient, drone: ServedFirmware) -> None:
        assert answers(client, b"\xff\xfe\x01") == b"\xff"
        for request in (b"\xff", b"\xff\xfe\x03", b"\xf0"):
            assert answers(client, request, 0.05) is None
        drone.call(drone.server.radio.press_button)
        assert client.exchange() == []
        drone.call(drone.server.radio.press_button)
        assert drone.server.radio.power is Power.ALL_OFF

    def test_reset_needs_its_first_step(self, client: RawClient, drone: ServedFirmware) -> None:
        assert answers(client, b"\xff\xfe\xf0\1") == b"\xff"
        assert drone.firmware.boot_count == 1
        assert answers(client, b"\xff\xfe\xff") == b"\xff\xfe\xff" + bytes.fromhex("e7e7e7e7e7e7")
        assert answers(client, b"\xff\xfe\xf0\1") == b"\xff"
        assert drone.firmware.boot_count == 2
        answers(client, b"\xff\xfe\xff")
        answers(client, b"\xff\xfe\xf0\0")  # to the bootloader
        assert drone.server.radio.power is Power.RADIO_ONLY


class TestSilence:
    """On a stepped clock: the drone's time is what counts."""

    def test_logging_stops_a_second_after_the_last_packet(self) -> None:
        clock = SteppedClock()
        with serve(MinimalFirmware(clock=clock)) as drone, RawClient(drone.uri) as client:
            client.exchange(b"\x51\6\1\x77\0\0", b"\x51\3\1\1")
            clock.now = 0.995
            client.wait_for(5, 2)
            clock.now = 2.0
            until(lambda: not drone.call(lambda: drone.server._log.blocks))
            assert client.ask(5, 1, b"\4\1") == [b"\4\1\2"]

    def test_polls_keep_it_alive(self) -> None:
        clock = SteppedClock()
        with serve(MinimalFirmware(clock=clock)) as drone, RawClient(drone.uri) as client:
            client.exchange(b"\x51\6\1\x77\0\0", b"\x51\3\1\1")
            for _ in range(5):
                clock.now += 0.9
                assert answers(client, b"\xff") == b"\xff"
            assert client.ask(5, 1, b"\4\1") == [b"\4\1\0"]

    def test_time_stamp_wraps_at_24_bits(self) -> None:
        clock = SteppedClock()
        with serve(MinimalFirmware(clock=clock)) as drone, RawClient(drone.uri) as client:
            clock.now = (2**24 - 5) / 1000 + 1e-4
            client.exchange(b"\x51\6\1\x77\0\0", b"\x51\x08\1\1\0")
            clock.now += 0.002
            assert client.wait_for(5, 2)[1:4] == b"\xfd\xff\xff"
            client.exchange()
            clock.now += 0.004
            stamp = client.wait_for(5, 2)[1:4]
            while stamp == b"\xfd\xff\xff":
                stamp = client.wait_for(5, 2)[1:4]
            assert stamp == b"\1\0\0"


def test_parameters_changed_by_the_firmware_are_announced_once(
    client: RawClient, drone: ServedFirmware
) -> None:
    client.exchange()

    def change() -> None:
        drone.firmware.params["ring.effect"] = 4
        drone.firmware.params["ring.effect"] = 5

    drone.call(change)
    ident = struct.pack("<H", drone.firmware.params.entry("ring.effect").ident)
    assert client.receive_param() == (3, b"\1" + ident + b"\5")
    assert client.exchange() == []


@settings(max_examples=examples(150), suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(hostile=st.lists(st.binary(max_size=34), min_size=1, max_size=8))
def test_hostile_datagrams_never_stop_the_server(hostile: list[bytes], drone: ServedFirmware) -> None:
    with RawClient(drone.uri) as client:
        hostile = [data for data in hostile if data[1:3] != b"\xfe\x01"]  # that one needs the button
        for reply in client.exchange(*hostile, b"\xff\xfe\x03"):
            assert len(reply.payload) <= 30


#: Packets with a valid beginning, which reach deeper than random bytes do.
commands = st.builds(
    Packet,
    st.sampled_from([2, 3, 4, 5, 6, 7, 8, 9, 13, 15]),
    st.integers(0, 3),
    st.builds(
        lambda command, ident, rest: bytes([command, ident, 0]) + rest,
        st.integers(0, 14),
        st.integers(0, 20),
        st.binary(max_size=27),
    ),
).filter(lambda packet: not packet.for_radio)


@settings(max_examples=examples(150), suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(packets=st.lists(commands, min_size=1, max_size=8))
def test_near_valid_packets_never_stop_the_server(packets: list[Packet], drone: ServedFirmware) -> None:
    with RawClient(drone.uri) as client:
        for reply in client.exchange(*(packet.encode() for packet in packets)):
            assert len(reply.payload) <= 30


class TestFaults:
    def test_loss_and_duplicates_at_the_stated_rate(self) -> None:
        faults = DatagramFaults(np.random.default_rng(3), loss=0.1, duplicate=0.2)
        counts = [len(faults.copies()) for _ in range(4000)]
        assert counts.count(0) / 4000 == pytest.approx(0.1, abs=0.02)
        assert counts.count(2) / 3600 == pytest.approx(0.2, abs=0.025)
        assert (faults.lost, faults.duplicated) == (counts.count(0), counts.count(2))

    def test_a_cut_link_is_silent_and_comes_back(self) -> None:
        faults = DatagramFaults(np.random.default_rng(4))
        with serve(MinimalFirmware(), faults) as drone, RawClient(drone.uri) as client:
            assert client.ask(15, 0, b"1") == [b"1"]
            faults.loss = 1.0
            assert answers(client, b"\xf0\2") is None
            faults.loss = 0.0
            assert client.ask(15, 0, b"3") == [b"3"]

    def test_delay_and_duplicates(self) -> None:
        faults = DatagramFaults(np.random.default_rng(5))
        with serve(MinimalFirmware(), faults) as drone, RawClient(drone.uri) as client:
            client.exchange()
            client.wait_for(0, 0)  # the console comes with a poll: the server knows the time now
            faults.duplicate, faults.delay_s = 1.0, (0.02, 0.03)
            start = time.monotonic()
            client.socket.send(b"\xf1\0")
            arrivals = []
            while len(arrivals) < 4:  # doubled on the way there and on the way back
                if client.receive().port == 15:
                    arrivals.append(time.monotonic() - start)
            assert arrivals[0] >= 0.035
