import math
import socket
import time

import pytest
from hypothesis import given
from hypothesis import strategies as st

from mocap_bridge.rotation import angle_between
from sim_backend.room.feed import (
    FeedError,
    FeedReceiver,
    FeedSender,
    FeedUpdate,
    TruePose,
    decode_feed,
    encode_feed,
)

IDENTITY = (0.0, 0.0, 0.0, 1.0)


def update(world_time: float, x: float, yaw: float = 0.0) -> FeedUpdate:
    pose = TruePose((x, 0.0, 1.0), (0.0, 0.0, math.sin(yaw / 2), math.cos(yaw / 2)))
    return FeedUpdate(world_time, {"cf1": pose})


def test_round_trip_of_several_bodies():
    sent = FeedUpdate(
        12.5, {"cf1": TruePose((1.0, 2.0, 3.0), IDENTITY), "é2": TruePose((0.0, -1.0, 0.5), IDENTITY)}
    )
    assert decode_feed(encode_feed(sent)) == [sent]


def test_updates_follow_each_other_in_a_datagram_and_a_torn_one_is_refused():
    sent = [update(0.1 * i, 1.0 * i) for i in range(3)]
    data = b"".join(encode_feed(one) for one in sent)
    assert decode_feed(data) == sent
    for torn in (data[:-1], data[:-80], data + b"\0", b""):
        with pytest.raises(FeedError):
            decode_feed(torn)


@pytest.mark.parametrize(
    "body",
    [
        {"n" * 25: TruePose((0.0, 0.0, 0.0), IDENTITY)},
        {"cf1": TruePose((math.nan, 0.0, 0.0), IDENTITY)},
        {"cf1": TruePose((0.0, 0.0), IDENTITY)},
    ],
)
def test_bodies_that_do_not_fit_are_refused(body):
    with pytest.raises(FeedError):
        encode_feed(FeedUpdate(0.0, body))


@given(st.binary(max_size=200))
def test_random_datagrams_give_an_update_or_a_feed_error(data: bytes):
    try:
        decode_feed(data)
    except FeedError:
        return


def test_sender_reaches_a_socket_and_survives_its_absence():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as receiver:
        receiver.bind(("127.0.0.1", 0))
        receiver.settimeout(2.0)
        with FeedSender(receiver.getsockname()[1]) as sender:
            assert sender.send(1.0, [("cf1", (1.0, 2.0, 3.0), IDENTITY)])
            assert decode_feed(receiver.recv(2048))[0].bodies["cf1"].position == (1.0, 2.0, 3.0)
            receiver.close()
            for i in range(10):
                sender.send(1.0 + i, [("cf1", (1.0, 2.0, 3.0), IDENTITY)])


def test_pose_at_an_exposure_lies_between_the_updates_around_it():
    receiver = FeedReceiver(timeout=0.05)
    for i in range(10):
        # Received 1 ms after the world's time, some of them later.
        receiver.observe(update(0.01 * i, x=0.1 * i, yaw=0.2 * i), 100.001 + 0.01 * i + 0.002 * (i % 3))
    pose = receiver.bodies_at(100.001 + 0.055)["cf1"]
    assert pose.position[0] == pytest.approx(0.55)
    assert angle_between(pose.quaternion, update(0.0, 0.0, 1.1).bodies["cf1"].quaternion) < 1e-6
    assert receiver.world_time(100.001 + 0.055) == pytest.approx(0.055)


def test_bodies_stand_still_beyond_the_newest_update_and_vanish_after_50_ms():
    receiver = FeedReceiver(timeout=0.05)
    receiver.observe(update(1.0, 0.0), 200.0)
    receiver.observe(update(1.01, 0.1), 200.01)
    assert receiver.bodies_at(200.05)["cf1"].position[0] == 0.1
    assert receiver.world_time(200.05) == 1.01
    assert receiver.bodies_at(200.061) == {}


def test_nothing_is_known_before_the_first_update():
    receiver = FeedReceiver(timeout=0.05)
    assert receiver.bodies_at(time.monotonic()) == {}
    assert receiver.world_time(time.monotonic()) is None


def test_a_world_that_starts_again_is_followed():
    receiver = FeedReceiver(timeout=0.05)
    receiver.observe(update(50.0, 9.0), 300.0)
    receiver.observe(update(0.0, 1.0), 300.02)
    assert receiver.bodies_at(300.03)["cf1"].position[0] == 1.0


def test_memory_is_bounded():
    receiver = FeedReceiver(timeout=0.05)
    for i in range(5000):
        receiver.observe(update(0.001 * i, 0.0), 0.001 * i)
    assert len(receiver._updates) <= 252
