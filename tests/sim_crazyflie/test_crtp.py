"""Packets as bytes."""

import pytest
from cflib.crtp.crtpstack import CRTPPacket
from hypothesis import given
from hypothesis import strategies as st

from sim_backend.crazyflie.crtp import NULL, PAYLOAD_MAX, Packet
from sim_backend.crazyflie.ports.console import console_packets

packets = st.builds(Packet, st.integers(0, 15), st.integers(0, 3), st.binary(max_size=PAYLOAD_MAX))


@given(packets)
def test_round_trip_and_agreement_with_cflib(packet: Packet) -> None:
    assert Packet.decode(packet.encode()) == packet
    theirs = CRTPPacket(header=packet.encode()[0], data=packet.payload)
    assert (theirs.port, theirs.channel, bytes(theirs.data)) == (packet.port, packet.channel, packet.payload)
    assert (
        Packet.decode(bytes([theirs.get_header()]) + packet.payload) == packet
    )  # cflib sets the reserved bits


@given(st.binary(max_size=64))
def test_any_bytes_decode_or_are_refused(data: bytes) -> None:
    packet = Packet.decode(data)
    assert (packet is None) == (len(data) not in range(1, 2 + PAYLOAD_MAX))


@pytest.mark.parametrize("header", [0xFF, 0xFB, 0xF7, 0xF3])
def test_null_packets(header: int) -> None:
    packet = Packet.decode(bytes([header]))
    assert packet is not None
    assert packet.is_null
    assert Packet.decode(NULL) == packet


def test_power_command_is_for_the_radio_and_no_null_packet() -> None:
    packet = Packet.decode(b"\xff\xfe\x02")
    assert packet is not None
    assert packet.for_radio
    assert not packet.is_null


@given(st.text(max_size=200))
def test_console_text_is_cut_into_ascii_packets(text: str) -> None:
    parts = console_packets(text)
    assert all(1 <= len(part.payload) <= PAYLOAD_MAX for part in parts)
    assert b"".join(part.payload for part in parts) == text.encode("ascii", "replace")
