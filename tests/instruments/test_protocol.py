"""The line protocol's parser: what it accepts, what it calls the rest, and that pieces do not matter."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from calibration.bench.instruments.protocol import (
    LINE_BYTES_MAX,
    Banner,
    EdgeLine,
    EventLine,
    Fault,
    HeartbeatLine,
    Kind,
    Line,
    LineParser,
    LoadLine,
    MarkLine,
    decode_line,
)
from tests.instruments.pty_device import crc_framed, framed

GOOD: dict[str, Line] = {
    "I,1,tach,1.0,t-7,4": Banner(1, Kind.TACHOMETER, "1.0", "t-7", 4),
    "I,1,load,sim1,0a1b2c3d,4": Banner(1, Kind.LOAD_CELL, "sim1", "0a1b2c3d", 4),
    "E,0,100": EdgeLine(0, (100,)),
    "E,65535,4294967000,200,200": EdgeLine(65535, (4294967000, 4294967200, 104)),
    "E,1,0,1,2,3,4,5,6,7": EdgeLine(1, (0, 1, 3, 6, 10, 15, 21, 28)),
    "H,7,4294967295,830,0,1": HeartbeatLine(7, 4294967295, 830, 0, 1),
    "L,9,12,-8388608": LoadLine(9, 12, -8388608),
    "L,9,12,8388607": LoadLine(9, 12, 8388607),
    "L,9,12,0": LoadLine(9, 12, 0),
    "M,3,5,step_1.up-2": MarkLine(3, 5, "step_1.up-2"),
    "X,3,5,1,hx711 not ready, check": EventLine(3, 5, 1, "hx711 not ready, check"),
}
#: Right checksum, wrong text: nobody sends this, so nobody may believe it.
MALFORMED = (
    "E,0",
    "E,0,100,0",
    "E,00,100",
    "E,0,+100",
    "E,0,100,",
    "E,0,1,1,1,1,1,1,1,1,1,1",
    "E,65536,100",
    "E,0,4294967296",
    "E,0,1e3",
    "E,0,-5",
    "H,1,2,3,0",
    "H,1,2,3,0,2",
    "H,1,2,3,0,1,1",
    "L,1,2,8388608",
    "L,1,2,-0",
    "L,1,2,-8388609",
    "L,1,2,3.5",
    "M,1,2,",
    "M,1,2,a b",
    "X,1,2,x,text",
    "I,3,tach,1,u,4",
    "I,1,gyro,1,u,4",
    "I,1,tach,1,u",
    "I,1,tach,,u,4",
)


@pytest.mark.parametrize("text", GOOD)
@pytest.mark.parametrize("end", [b"\n", b"\r\n"])
def test_good_lines_become_what_they_say(text: str, end: bytes) -> None:
    parser = LineParser()
    assert parser.feed(framed(text) + end) == [GOOD[text]]
    assert not parser.faults


@pytest.mark.parametrize("text", MALFORMED)
def test_text_that_nobody_sends_is_refused_in_spite_of_its_checksum(text: str) -> None:
    assert decode_line(framed(text), 1) is Fault.FORMAT


@pytest.mark.parametrize(
    ("raw", "fault"),
    [
        (b"E,1,100*00", Fault.CHECKSUM),
        (framed("E,1,100")[:-1], Fault.PARTIAL),
        (b"E,1,10", Fault.PARTIAL),
        (framed("E,1,100") + framed("E,2,200"), Fault.MERGED),
        (framed("E,1,100").replace(b"1", b"\0", 1), Fault.GARBAGE),
        (b"\xff\xfe\xfd", Fault.GARBAGE),
        (b"Hello world", Fault.GARBAGE),
        (framed("Z,1,100"), Fault.GARBAGE),
        (framed("X,1,2,3," + "t" * LINE_BYTES_MAX), Fault.TOO_LONG),
        (b"t" * 10 * LINE_BYTES_MAX, Fault.TOO_LONG),
    ],
)
def test_each_bad_line_is_counted_by_its_reason_and_the_next_one_is_good(raw: bytes, fault: Fault) -> None:
    parser = LineParser()
    assert parser.feed(raw + b"\n" + framed("E,5,7") + b"\n") == [EdgeLine(5, (7,))]
    assert parser.faults == {fault: 1}


def test_the_end_of_a_line_that_is_too_long_is_not_taken_for_a_line() -> None:
    parser = LineParser()
    for piece in (b"x" * (LINE_BYTES_MAX + 1), framed("E,5,7") + b"\n", framed("E,6,8") + b"\n"):
        lines = parser.feed(piece)
    assert lines == [EdgeLine(6, (8,))]
    assert parser.faults == {Fault.TOO_LONG: 1}


def test_after_a_banner_of_protocol_2_only_its_checksum_counts() -> None:
    parser = LineParser()
    lines = parser.feed(
        b"\n".join(
            (crc_framed("I,2,tach,1,u,4"), framed("E,1,1"), crc_framed("E,2,2"), framed("H,3,3,0,0,0"), b"")
        )
    )
    assert lines == [Banner(2, Kind.TACHOMETER, "1", "u", 4), EdgeLine(2, (2,))]
    assert sum(parser.faults.values()) == 2
    assert parser.feed(framed("I,1,tach,1,u,4") + b"\n" + framed("E,1,1") + b"\n")[1:] == [EdgeLine(1, (1,))]


STREAM = b"".join(framed(text) + (b"\r\n" if i % 2 else b"\n") for i, text in enumerate(GOOD))


@given(st.lists(st.integers(0, len(STREAM)), max_size=12))
def test_the_pieces_in_which_bytes_arrive_do_not_matter(cuts: list[int]) -> None:
    parser = LineParser()
    ends = [*sorted(cuts), len(STREAM)]
    starts = [0, *ends[:-1]]
    lines = [line for a, b in zip(starts, ends, strict=True) for line in parser.feed(STREAM[a:b])]
    assert lines == list(GOOD.values())


@given(st.lists(st.binary(max_size=300), max_size=8))
def test_any_bytes_are_survived_in_little_memory_and_the_next_line_is_heard(pieces: list[bytes]) -> None:
    parser = LineParser()
    for piece in pieces:
        parser.feed(piece)
    assert parser.feed(b"\n" + framed("E,5,7") + b"\n")[-1] == EdgeLine(5, (7,))
    assert len(parser._rest) <= LINE_BYTES_MAX + 1


@given(
    st.sampled_from(list(GOOD)),
    st.integers(0, 200),
    st.integers(1, 255),
    st.sampled_from([framed, crc_framed]),
)
def test_no_line_with_one_changed_byte_says_something_else(
    text: str, at: int, change: int, frame: object
) -> None:
    text = text.replace("I,1", "I,2") if frame is crc_framed else text
    protocol = 2 if frame is crc_framed else 1
    line = bytearray(frame(text))  # type: ignore[operator]
    true = decode_line(bytes(line), protocol)
    line[at % len(line)] ^= change
    found = decode_line(bytes(line), protocol)
    assert isinstance(found, Fault) or found == true


@given(st.sampled_from(list(GOOD)), st.integers(0, 200), st.integers(1, 4))
def test_no_line_of_protocol_2_with_lost_bytes_says_something_else(text: str, at: int, count: int) -> None:
    line = crc_framed(text.replace("I,1", "I,2"))
    at %= len(line)
    found = decode_line(line[:at] + line[at + count :], 2)
    assert isinstance(found, Fault)
