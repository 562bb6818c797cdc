import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from mocap_bridge.errors import PacketError
from mocap_bridge.tracker_udp import (
    BLOCK_SIZES,
    TrackerBlock,
    TrackerItem,
    block_capacity,
    decode_block,
    encode_blocks,
)
from tests.mocap.vectors import TRACKER_BLOCK_START

CF1 = TrackerItem("cf1", (1000.0, -2000.0, 1500.5), (0.1, -0.2, 3.0))
CF2 = TrackerItem("cf2", (0.0, 0.0, 0.0), (0.0, 0.0, 0.0))


def test_example_encodes_and_decodes_exactly():
    (block,) = encode_blocks(1234, [CF1, CF2], 256)
    assert block[:80] == TRACKER_BLOCK_START
    assert len(block) == 256
    assert decode_block(block) == TrackerBlock(1234, (CF1, CF2))


def test_capacities_are_those_of_tracker():
    assert [block_capacity(size) for size in BLOCK_SIZES] == [3, 6, 13]


@pytest.mark.parametrize("block_size", BLOCK_SIZES)
def test_more_objects_than_a_block_holds_go_into_several_of_the_same_frame(block_size: int):
    items = [TrackerItem(f"body{i}", (float(i), 1.0, 2.0), (0.0, 0.1, 0.2)) for i in range(20)]
    blocks = [decode_block(data) for data in encode_blocks(9, items, block_size)]
    assert {block.frame for block in blocks} == {9}
    assert [item for block in blocks for item in block.items] == items


def test_a_frame_without_objects_is_still_a_datagram():
    (block,) = encode_blocks(5, [], 256)
    assert decode_block(block) == TrackerBlock(5, ())


def test_long_names_are_cut_at_23_bytes():
    (data,) = encode_blocks(1, [TrackerItem("n" * 40, (1.0, 0.0, 0.0), (0.0, 0.0, 0.0))], 256)
    assert decode_block(data).items[0].name == "n" * 23


def test_zeros_and_nan_are_no_pose():
    assert CF1.has_pose()
    assert not CF2.has_pose()
    assert not TrackerItem("a", (math.nan, 1.0, 1.0), (0.0, 0.0, 0.0)).has_pose()
    assert not TrackerItem("a", (1.0, 1.0, 1.0), (0.0, math.inf, 0.0)).has_pose()


@given(st.sampled_from(BLOCK_SIZES), st.data())
def test_random_datagrams_give_a_block_or_a_packet_error(block_size: int, data: st.DataObject):
    content = data.draw(st.binary(min_size=block_size, max_size=block_size))
    try:
        block = decode_block(content)
    except PacketError:
        return
    assert len(block.items) <= block_capacity(block_size)


@given(st.binary(max_size=300).filter(lambda content: len(content) not in BLOCK_SIZES))
def test_unpadded_datagrams_are_refused(content: bytes):
    with pytest.raises(PacketError):
        decode_block(content)
