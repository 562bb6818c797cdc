"""Which replies pass, which are duplicates, and what is sent again when."""

import itertools

import pytest
from cflib.crtp.crtpstack import CRTPPacket
from hypothesis import given
from hypothesis import strategies as st

from onboard.link.replies import FORGET_AFTER, OutstandingRequests, reply_key

# Request and reply of every exchange that demands an answer, as the protocol's tables give them (header,
# payload).
EXCHANGES = {
    "link source": (0xFD, b"\0", 0xF1, b"Bitcraze Crazyflie".ljust(30, b"\0")),
    "protocol version": (0xDD, b"\0", 0xD1, b"\0\x0c\0\0\0"),
    "log table size": (0x5C, b"\x03", 0x50, b"\x03\x37\x02\x7b\x35\x04\xc1\x10\x80"),
    "log table item": (0x5C, b"\x02\x07\x01", 0x50, b"\x02\x07\x01\x07pm\0vbat\0"),
    "log reset": (0x5D, b"\x05", 0x51, b"\x05\0\0"),
    "log create": (0x5D, b"\x06\x03\x77\x01\0", 0x51, b"\x06\x03\0"),
    "log start": (0x5D, b"\x03\x03\x01", 0x51, b"\x03\x03\0"),
    "parameter table size": (0x2C, b"\x03", 0x20, b"\x03\x4f\x01\x0f\x2a\x95\x15"),
    "parameter table item": (0x2C, b"\x02\x2c\x01", 0x20, b"\x02\x2c\x01\x06a\0b\0"),
    "parameter read": (0x2D, b"\x2c\x01", 0x21, b"\x2c\x01\0\x05"),
    "parameter write": (0x2E, b"\x2c\x01\x05", 0x22, b"\x2c\x01\x05"),
    "extended type": (0x2F, b"\x07\x2c\x01", 0x23, b"\x07\x2c\x01\0\x01"),
    "number of memories": (0x4C, b"\x01", 0x40, b"\x01\x05"),
    "memory details": (0x4C, b"\x02\x03", 0x40, b"\x02\x03\x18\0\x20\0\0" + bytes(8)),
    "memory read": (0x4D, b"\x03\x18\0\0\0\x18", 0x41, b"\x03\x18\0\0\0\0" + bytes(24)),
    "memory write": (0x4E, b"\x03\x18\0\0\0" + bytes(24), 0x42, b"\x03\x18\0\0\0\0"),
    "supervisor information": (0x9C, b"\x0c", 0x90, b"\x8c\x01\x00"),
    "arm": (0x9D, b"\x01\x01", 0x91, b"\x81\x01\x01"),
    "recover": (0x9D, b"\x02", 0x91, b"\x82\x01\x01"),
}

# What the drone may say any number of times, byte for byte the same.
REPEATABLE = {
    "console": b"\x00SYS: hello\n",
    "echo": b"\xf0\x00" + bytes(8),
    "parameter pushed by the firmware": b"\x23\x01\x2c\x01\x05",
    "app channel": b"\xd2\x01\x02",
    "localization": b"\x61\x00\x01",
    "commander": b"\x80\x07\x00\x00\x00",
    "null": b"\xf3",
    "power switch": b"\xf3\xfe\x02",
}


@pytest.mark.parametrize("name", EXCHANGES)
def test_one_reply_passes_per_request(name: str) -> None:
    header, request, reply_header, reply = EXCHANGES[name]
    requests = OutstandingRequests()
    answer = bytes((reply_header,)) + reply
    assert not requests.accept(answer, 0.0), "a reply that nobody asked for"
    for start in (1.0, 2.0):
        assert requests.sending(CRTPPacket(header, request), start)
        assert requests.accept(answer, start + 0.001)
        assert not requests.accept(answer, start + 0.002)


@pytest.mark.parametrize("name", EXCHANGES)
def test_replies_do_not_settle_other_requests(name: str) -> None:
    header, request, _, _ = EXCHANGES[name]
    requests = OutstandingRequests()
    requests.sending(CRTPPacket(header, request), 0.0)
    for other, (_, _, reply_header, reply) in EXCHANGES.items():
        if other != name:
            assert not requests.accept(bytes((reply_header,)) + reply, 0.0), other
    assert len(requests) == 1


@pytest.mark.parametrize("name", REPEATABLE)
def test_what_may_repeat_always_passes(name: str) -> None:
    requests = OutstandingRequests()
    assert all(requests.accept(REPEATABLE[name], 0.0) for _ in range(5))


def test_log_data_passes_once_per_block_and_time() -> None:
    requests = OutstandingRequests()
    first, second = b"\x52\x01\x0a\x00\x00\x05", b"\x52\x01\x14\x00\x00\x05"
    assert requests.accept(first, 0.0)
    assert requests.accept(second, 0.0)
    assert not requests.accept(first, 0.0)
    assert requests.accept(b"\x52\x02" + first[2:], 0.0)


def test_a_late_read_reply_does_not_answer_a_write_of_the_same_parameter() -> None:
    requests = OutstandingRequests()
    requests.sending(CRTPPacket(0x2E, b"\x05\0\x01"), 0.0)
    assert not requests.accept(b"\x21\x05\0\0\x00", 0.0)
    assert requests.accept(b"\x22\x05\0\x01", 0.0)


def test_the_echo_of_an_earlier_value_does_not_answer_a_write() -> None:
    requests = OutstandingRequests()
    requests.sending(CRTPPacket(0x2E, b"\x05\0\x01"), 0.0)
    latest = CRTPPacket(0x2E, b"\x05\0\x00")
    requests.sending(latest, 0.001)
    assert not requests.accept(b"\x22\x05\0\x01", 0.002)
    assert requests.due(1.0) == [latest], "the value that was given up is not sent again"
    assert requests.accept(b"\x22\x05\0\x00", 1.001)


def test_resends_wait_longer_up_to_a_tenth_of_a_second_and_end() -> None:
    requests = OutstandingRequests()
    packet = CRTPPacket(0x2D, b"\x05\0")
    requests.sending(packet, 0.0)
    sent = [step / 1000 for step in range(6000) if requests.due(step / 1000)]
    gaps = [later - earlier for earlier, later in itertools.pairwise(sent)]
    assert sent[0] == pytest.approx(0.05, abs=2e-3)
    assert gaps[0] == pytest.approx(0.1, abs=2e-3)
    assert max(gaps) <= 0.102
    assert sent[-1] <= FORGET_AFTER
    assert len(requests) == 0


def test_resend_interval_follows_the_round_trip() -> None:
    requests = OutstandingRequests()
    now = 0.0
    for _ in range(50):
        requests.sending(CRTPPacket(0x2D, b"\x05\0"), now)
        assert requests.accept(b"\x21\x05\0\0\x00", now + 0.02)
        now += 0.1
    requests.sending(CRTPPacket(0x2D, b"\x05\0"), now)
    assert not requests.due(now + 0.079)
    assert requests.due(now + 0.081)


def test_a_round_trip_longer_than_the_first_interval_is_found_out() -> None:
    """Else each request of a slow link would leave twice for ever."""
    requests = OutstandingRequests()
    resends = []
    for number in range(20):
        now = float(number)
        requests.sending(CRTPPacket(0x2D, b"\x05\0"), now)
        resends.append(sum(len(requests.due(now + step / 1000)) for step in range(60)))
        assert requests.accept(b"\x21\x05\0\0\x00", now + 0.06)
    assert resends[0] == 1
    assert sum(resends[5:]) == 0


def test_a_new_request_with_the_same_key_replaces_the_old_one() -> None:
    requests = OutstandingRequests()
    old, new = CRTPPacket(0x2D, b"\x05\0"), CRTPPacket(0x2D, b"\x05\0")
    requests.sending(old, 0.0)
    requests.sending(new, 0.01)
    assert requests.due(1.0) == [new]
    assert requests.accept(b"\x21\x05\0\0\x00", 1.0)
    assert not requests.accept(b"\x21\x05\0\0\x00", 1.0)


@given(st.integers(0, 255), st.binary(max_size=30))
def test_any_bytes_have_a_key_or_none_and_link_bits_do_not_matter(header: int, payload: bytes) -> None:
    assert reply_key(header, payload) == reply_key(header ^ 0x0C, payload)
