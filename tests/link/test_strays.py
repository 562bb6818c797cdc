"""A write that was settled stays: no late copy of an earlier one brings the old value back."""

import heapq
import itertools

import numpy as np
from cflib.crtp.crtpstack import CRTPPacket
from hypothesis import given
from hypothesis import strategies as st

from onboard.link.replies import OutstandingRequests
from onboard.link.strays import LIFETIME_S

_STEP = 0.001
WRITE, ECHO = 0x2E, b"\x22"
IDENT = b"\x05\0"


class Variable:
    """A drone's parameter behind a network that loses and delays, in a time of its own."""

    def __init__(self, rng: np.random.Generator, loss: float, late: float, doubled: float) -> None:
        self.requests = OutstandingRequests()
        self.now = 0.0
        self.value = b""
        self._rng, self._loss, self._late, self._doubled = rng, loss, late, doubled
        self._under_way: list[tuple[float, int, bytes, bool]] = []
        self._order = itertools.count()

    def write(self, value: int, ident: bytes = IDENT) -> None:
        """Returns when the answer has passed."""
        packet = CRTPPacket(WRITE, ident + bytes((value,)))
        self.requests.sending(packet, self.now)
        self._send(bytes(packet.data), to_drone=True)
        while not self.pass_time():
            pass

    def pass_time(self) -> bool:
        """A millisecond; whether an answer passed."""
        self.now += _STEP
        for packet in self.requests.due(self.now):
            self._send(bytes(packet.data), to_drone=True)
        settled = False
        while self._under_way and self._under_way[0][0] <= self.now:
            _, _, data, to_drone = heapq.heappop(self._under_way)
            if to_drone:
                self.value = data[2:] if data.startswith(IDENT) else self.value
                self._send(data, to_drone=False)
            else:
                settled |= self.requests.accept(ECHO + data, self.now)
        return settled

    def _send(self, data: bytes, to_drone: bool) -> None:
        for _ in range(1 + (self._rng.random() < self._doubled)):
            if self._rng.random() < self._loss:
                continue
            delay = self._rng.exponential(0.002)
            if self._rng.random() < self._late:
                delay = self._rng.uniform(0.0, 0.49 * LIFETIME_S)
            heapq.heappush(self._under_way, (self.now + delay, next(self._order), data, to_drone))


@given(
    st.integers(0, 2**32 - 1),
    st.floats(0.0, 0.2),
    st.floats(0.0, 0.3),
    st.sampled_from([0.0, 0.0, 0.05, 0.5]),
    st.lists(st.integers(0, 3), max_size=8),
)
def test_what_was_written_stays_written(
    seed: int, loss: float, late: float, doubled: float, values: list[int]
) -> None:
    """At the answer and for as long as any copy of what was sent before can still arrive, once a network that
    doubles has shown that it does."""
    variable = Variable(np.random.default_rng(seed), loss, late, doubled)
    others = (number.to_bytes(2, "little") for number in itertools.count(6))
    while doubled and not variable.requests.doubled:
        variable.write(0, next(others))
    for value in values:
        variable.write(value)
        assert variable.value == bytes((value,))
        for _ in range(int(variable.now * 997) % 40):
            variable.pass_time()
            assert variable.value == bytes((value,))
    for _ in range(int(LIFETIME_S / _STEP) + 1):
        variable.pass_time()
        assert not values or variable.value == bytes((values[-1],))


def test_one_answer_too_many_tells_a_network_that_doubles() -> None:
    requests = OutstandingRequests()
    requests.sending(CRTPPacket(0x2D, b"\7\0"), 0.0)
    assert requests.accept(b"\x21\7\0\0\1", 0.01)
    assert not requests.doubled
    assert not requests.accept(b"\x21\7\0\0\1", 0.02)
    assert requests.doubled
    requests.sending(CRTPPacket(WRITE, IDENT + b"\1"), 1.0)
    assert requests.accept(ECHO + IDENT + b"\1", 1.01), "nothing came before"
    requests.sending(CRTPPacket(WRITE, IDENT + b"\2"), 1.1)
    assert not requests.accept(ECHO + IDENT + b"\2", 1.11), "a double of the first may be under way"
    requests.sending(CRTPPacket(WRITE, IDENT + b"\2"), 3.0)
    assert requests.accept(ECHO + IDENT + b"\2", 3.01), "no longer"


def test_a_disarming_leaves_at_once_and_is_said_again_when_no_late_arming_can_come() -> None:
    requests = OutstandingRequests()
    arm, disarm = CRTPPacket(0x9D, b"\x01\x01"), CRTPPacket(0x9D, b"\x01\x00")
    requests.sending(arm, 0.0)
    assert requests.due(0.06) == [arm]
    assert requests.accept(b"\x91\x81\x01\x01", 0.07)
    requests.sending(disarm, 0.08)  # the driver transmits what it is told of
    assert not requests.accept(b"\x91\x81\x01\x00", 0.09), "the other arming may be under way"
    assert not requests.due(0.07 + LIFETIME_S), "the answer to the first disarming may still come"
    assert requests.due(0.08 + LIFETIME_S) == [disarm]
    assert requests.accept(b"\x91\x81\x01\x00", 0.09 + LIFETIME_S)


def test_nothing_waits_where_every_copy_was_answered() -> None:
    requests = OutstandingRequests()
    requests.sending(CRTPPacket(WRITE, IDENT + b"\1"), 0.0)
    requests.due(0.06)
    assert requests.accept(ECHO + IDENT + b"\1", 0.07)
    assert not requests.accept(ECHO + IDENT + b"\1", 0.071)
    requests.sending(CRTPPacket(WRITE, IDENT + b"\2"), 0.08)
    assert requests.accept(ECHO + IDENT + b"\2", 0.09)
