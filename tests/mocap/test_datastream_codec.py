import hashlib
import struct
import tracemalloc

import pytest
from hypothesis import given
from hypothesis import strategies as st

from mocap_bridge.datastream.objects import (
    LAYOUTS,
    OBJECT_IDS,
    ApplicationInfo,
    CameraInfo,
    FrameInfo,
    FrameRateInfo,
    GlobalSegments,
    LabeledReconstruction,
    LabeledReconstructions,
    LatencyInfo,
    LightweightSegment,
    LightweightSegments,
    ObjectEnums,
    ObjectQuality,
    PacketContents,
    Ping,
    Reconstruction,
    RequestFrame,
    RequestNextFrame,
    Segment,
    SegmentPose,
    StreamInfo,
    SubjectHealth,
    SubjectInfo,
    SubjectScale,
    SubjectTopology,
    Timecode,
    UnlabeledReconstructions,
)
from mocap_bridge.datastream.packet import (
    MAGIC,
    PACKET_BYTES_LIMIT,
    PacketBuffer,
    decode_packet,
    encode_packet,
)
from mocap_bridge.errors import PacketError
from tests.mocap.vectors import CAMERA_FIELDS, DATASTREAM_PACKET, DATASTREAM_SHA256, LABELED_FIELDS

COUNTING = (0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0)


def f32(value: float) -> float:
    return struct.unpack("<f", struct.pack("<f", value))[0]


# What Vicon's serializers were given, in their order.
GOLDEN_OBJECTS = [
    ObjectEnums((1, 2, 5, 9, 100004)),
    PacketContents(((2, 1), (9, 1)), (1, 2)),
    StreamInfo(1350000),
    ApplicationInfo(0),
    SubjectInfo(7, "cf1", (Segment(0, 1, (0.0,) * 6, "cf1"),), ((3, "m3"),), ((3, 1),)),
    SubjectTopology(7, (SegmentPose(1, (0.0, 1.0, 2.0), COUNTING),)),
    SubjectScale(7, ((1, (1.0, 1.0, 1.0)),)),
    SubjectHealth(7, 0.2, 0.9),
    ObjectQuality(7, 0.8),
    FrameInfo(1234),
    LatencyInfo((("Data Processed", 0.0021),)),
    FrameRateInfo((("Tracker", 100.0),)),
    Timecode(1, 2, 3, 4, 0, 0, -1, 0, 0),
    GlobalSegments(7, (SegmentPose(1, (0.5, 1.5, 2.5), COUNTING),)),
    LightweightSegments(7, (LightweightSegment(1, (0.5, 1.5, 2.5), (0.0, f32(0.1), f32(0.2))),)),
    UnlabeledReconstructions((Reconstruction(7.0, (0.0, 1.0, 2.0), (0.0,) * 9, 5),)),
    Ping(77),
    RequestFrame(1),
    RequestNextFrame(1),
]


@pytest.mark.parametrize(
    ("item", "fields"),
    [
        (
            CameraInfo(3, 1350000, "Vero", "Vero v2.2", "east", 2048, 1088, 1.0, 0.4, 1, 0, 4, 5.5),
            CAMERA_FIELDS,
        ),
        (
            LabeledReconstructions((LabeledReconstruction(7, 2, 4.5, (0.5, 1.5, 2.5), COUNTING, 11),)),
            LABELED_FIELDS,
        ),
    ],
)
def test_cameras_and_labelled_markers_have_the_bytes_of_vicons_serializers(item, fields):
    assert encode_packet([item]).endswith(fields)
    assert decode_packet(encode_packet([item])) == [item]


def test_the_vector_is_the_one_that_was_recorded():
    assert hashlib.sha256(DATASTREAM_PACKET).hexdigest() == DATASTREAM_SHA256


def test_decodes_vicons_own_bytes():
    assert decode_packet(DATASTREAM_PACKET) == GOLDEN_OBJECTS


def test_encodes_to_vicons_own_bytes():
    assert encode_packet(GOLDEN_OBJECTS) == DATASTREAM_PACKET


def test_every_layout_has_an_object_id_and_back():
    assert {OBJECT_IDS[layout.make] for layout in LAYOUTS.values()} == set(LAYOUTS)


def test_unwanted_and_unknown_objects_are_stepped_over():
    assert decode_packet(DATASTREAM_PACKET, wanted={5}) == [FrameInfo(1234)]
    unknown = struct.pack("<II3s", 4711, 3, b"abc")
    body = unknown + encode_packet([FrameInfo(7)])[8:]
    assert decode_packet(struct.pack("<II", MAGIC, len(body)) + body) == [FrameInfo(7)]


@given(st.binary(max_size=400))
def test_random_bytes_give_objects_or_a_packet_error(data: bytes):
    try:
        decode_packet(data)
    except PacketError:
        return


@given(st.sampled_from(sorted(LAYOUTS)), st.binary(max_size=200))
def test_random_payloads_give_an_object_or_a_packet_error(object_id: int, payload: bytes):
    body = struct.pack("<II", object_id, len(payload)) + payload
    try:
        (item,) = decode_packet(struct.pack("<II", MAGIC, len(body)) + body)
    except PacketError:
        return
    # What was accepted was understood to the last byte: it encodes to bytes that mean the same.
    again = encode_packet([item])
    assert len(again) == 8 + len(body)


@pytest.mark.parametrize("length", range(0, len(DATASTREAM_PACKET), 7))
def test_a_cut_packet_is_an_error(length: int):
    with pytest.raises(PacketError):
        decode_packet(DATASTREAM_PACKET[:length])


@given(st.integers(8, len(DATASTREAM_PACKET) - 1), st.integers(0, 255))
def test_a_changed_byte_never_escapes_the_errors_of_the_package(position: int, value: int):
    data = bytearray(DATASTREAM_PACKET)
    data[position] = value
    try:
        decode_packet(bytes(data))
    except PacketError:
        return


@pytest.mark.parametrize("object_id", [2, 7, 9, 26, 901, 100001, 100004])
def test_a_lying_count_reserves_no_memory(object_id: int):
    payload = struct.pack("<I", 0xFFFFFFFF) * 3
    body = struct.pack("<II", object_id, len(payload)) + payload
    packet = struct.pack("<II", MAGIC, len(body)) + body
    tracemalloc.start()
    try:
        with pytest.raises(PacketError):
            decode_packet(packet)
        _, peak = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert peak < 100_000


@pytest.mark.parametrize(
    "item",
    [FrameInfo(-1), FrameInfo(2**32), GlobalSegments(1, (SegmentPose(1, (0.0, 0.0), (0.0,) * 9),))],
)
def test_values_that_do_not_fit_are_refused(item: FrameInfo):
    with pytest.raises(PacketError):
        encode_packet([item])


@given(st.lists(st.integers(1, 60), max_size=80))
def test_buffer_gives_the_same_packets_however_the_stream_is_cut(cuts: list[int]):
    packets = [DATASTREAM_PACKET, encode_packet([Ping(1)]), encode_packet([]), DATASTREAM_PACKET]
    stream = b"".join(packets)
    buffer, got, position = PacketBuffer(), [], 0
    for size in [*cuts, len(stream)]:
        buffer.feed(stream[position : position + size])
        position += size
        while (packet := buffer.next_packet()) is not None:
            got.append(packet)
    assert got == packets


def test_buffer_refuses_a_foreign_stream_and_an_endless_packet():
    foreign = PacketBuffer()
    foreign.feed(b"HTTP/1.1 200 OK\r\n")
    with pytest.raises(PacketError, match="not a Vicon DataStream"):
        foreign.next_packet()
    endless = PacketBuffer()
    endless.feed(struct.pack("<II", MAGIC, PACKET_BYTES_LIMIT + 1))
    with pytest.raises(PacketError, match="limit"):
        endless.next_packet()
