"""Log streams of the link, against a peer written from the byte tables."""

import struct
import threading

import pytest

from onboard.link import (
    DroneLink,
    LinkInputError,
    LogSample,
    NoSuchVariable,
)
from onboard.link.logs import QUEUE_LIMIT, unwrap
from tests.link.tiny_drone import TinyDrone
from tests.patience import PATIENCE_S


class Samples:
    """A callback that collects samples."""

    def __init__(self) -> None:
        self.samples: list[LogSample] = []
        self._arrived = threading.Condition()

    def __call__(self, sample: LogSample) -> None:
        with self._arrived:
            self.samples.append(sample)
            self._arrived.notify_all()

    def wait_for(self, count: int) -> list[LogSample]:
        with self._arrived:
            assert self._arrived.wait_for(lambda: len(self.samples) >= count, timeout=PATIENCE_S), (
                self.samples
            )
        return self.samples


@pytest.mark.parametrize(
    ("known", "raw", "expected"),
    [
        (None, 5, 5),
        (0xFFFFF0, 0x10, 0x1000010),
        (0x1000010, 0xFFFFF0, 0xFFFFF0),
        (0x2000005, 0x000006, 0x2000006),
    ],
)
def test_drone_time_is_unwrapped(known: int | None, raw: int, expected: int) -> None:
    assert unwrap(known, raw) == expected


def test_stream_delivers_typed_samples_in_order_across_the_wrap(tiny: TinyDrone, link: DroneLink) -> None:
    samples = Samples()
    with link.stream(["stateEstimate.x", "pm.vbatMV"], 10, samples) as stream:
        for step in range(4):
            tiny.push_log(stream.block, 0xFFFFEC + 10 * step, struct.pack("<fH", 0.5 * step, 3700 + step))
        tiny.push_log(stream.block, 0xFFFFEC + 15, struct.pack("<fH", 7.0, 7))  # overtaken on the way
        tiny.push_log(stream.block, 0xFFFFEC + 45, struct.pack("<f", 0.5))  # too short
        tiny.push_log(stream.block, 0xFFFFEC + 50, struct.pack("<fH", 9.0, 9))
        got = samples.wait_for(5)
        assert [s.drone_time_ms - 0xFFFFEC for s in got] == [0, 10, 20, 30, 50]
        assert got[1].values == {"stateEstimate.x": 0.5, "pm.vbatMV": 3701}
        assert stream.latest is got[-1]
        assert 0.0 <= stream.age() < PATIENCE_S
        assert (stream.received, stream.late, stream.malformed) == (5, 1, 1)
    assert tiny.blocks == {}


def test_stream_limits_are_input_errors(link: DroneLink) -> None:
    with pytest.raises(NoSuchVariable):
        link.stream(["stateEstimate.y"], 10, lambda _sample: None)
    for period in (0, 15, 2550):
        with pytest.raises(LinkInputError, match="period"):
            link.stream(["pm.vbatMV"], period, lambda _sample: None)
    with pytest.raises(LinkInputError, match="bytes"):
        link.stream(["stateEstimate.x"] * 7, 10, lambda _sample: None)
    with pytest.raises(LinkInputError, match="twice"):  # 22 bytes: there is room for its largest
        link.stream(["pm.vbatMV"] * 11, 10, lambda _sample: None)


def test_lost_answer_to_a_block_command_is_repaired(tiny: TinyDrone, link: DroneLink) -> None:
    answered: list[bytes] = []

    def lose_first_create_answer(reply: bytes) -> int:
        if reply[0] == 0x51 and reply[1] == 6:
            answered.append(reply)
            return 0 if len(answered) == 1 else 1
        return 1

    tiny.copies = lose_first_create_answer
    samples = Samples()
    with link.stream(["stateEstimate.z"], 10, samples) as stream:
        assert tiny.blocks[stream.block] == [1]
        tiny.push_log(stream.block, 10, struct.pack("<f", 2.0))
        samples.wait_for(1)


def test_slow_callback_loses_the_oldest_samples_and_blocks_nobody(tiny: TinyDrone, link: DroneLink) -> None:
    go_on, samples = threading.Event(), Samples()

    def slow(sample: LogSample) -> None:
        go_on.wait(PATIENCE_S)
        samples(sample)

    with link.stream(["stateEstimate.x"], 10, slow) as stream:
        count = QUEUE_LIMIT + 50
        for step in range(count):
            tiny.push_log(stream.block, 10 * step, struct.pack("<f", step))
            if step % 50 == 0:
                assert link.param("ring.solid") == 0.25
        assert link.param("ring.solid") == 0.25
        assert stream.received == count
        assert stream.dropped in (49, 50)
        go_on.set()
        got = samples.wait_for(count - stream.dropped)
        assert got[-1].values["stateEstimate.x"] == count - 1


@pytest.mark.filterwarnings("ignore::pytest.PytestUnhandledThreadExceptionWarning")
def test_callback_that_raises_ends_its_stream_only(tiny: TinyDrone, link: DroneLink) -> None:
    samples = Samples()

    def broken(_sample: LogSample) -> None:
        raise ZeroDivisionError

    bad = link.stream(["stateEstimate.x"], 10, broken)
    good = link.stream(["stateEstimate.x"], 10, samples)
    for stream in (bad, good):
        tiny.push_log(stream.block, 10, struct.pack("<f", 1.0))
    samples.wait_for(1)
    bad._thread.join(PATIENCE_S)
    assert (bad.alive, good.alive) == (False, True)
    bad.close()
