"""A simulated room with a body that moves in real time, for tests."""

import math
import threading
import time
from collections.abc import Callable
from dataclasses import replace
from typing import Self

import numpy as np

from mocap_bridge.pose import PoseSample, PoseStream
from mocap_bridge.rotation import Quaternion, Vector
from sim_backend.room.feed import FeedSender
from sim_backend.room.settings import RoomSettings
from tests.patience import PATIENCE_S
from tests.room_thread import RoomThread

Bodies = list[tuple[str, Vector, Quaternion]]
FREE_PORTS = RoomSettings(vicon_port=0, vicon_udp_port=0)


def circling(world_time: float) -> Bodies:
    """cf1 on a circle of 1 m radius at 1 m/s, nose along its path."""
    t = world_time
    return [("cf1", (math.cos(t), math.sin(t), 1.0), (0.0, 0.0, math.sin(t / 2), math.cos(t / 2)))]


def samples_seen(stream: PoseStream, count: int) -> list[PoseSample]:
    """The next `count` samples with a pose: a body whose feed stood still, on a busy machine, is left out."""
    samples: list[PoseSample] = []
    while len(samples) < count:
        sample = stream.read(PATIENCE_S)
        if not sample.occluded:
            samples.append(sample)
    return samples


class MovingRoom:
    """A room on free ports with a feed at 500 Hz; `feeding` cleared stops the feed as a dead world would.

    Its time is the monotonic clock's since `start_time`: what is taken from that, the world skips.
    """

    def __init__(self, motion: Callable[[float], Bodies] = circling, **settings: object) -> None:
        self.settings = replace(FREE_PORTS, **settings)  # type: ignore[arg-type]
        self._motion = motion
        self._thread = RoomThread(self.settings, np.random.default_rng(1))
        self._stop = threading.Event()
        self.feeding = threading.Event()
        self.feeding.set()
        self._feeder = threading.Thread(target=self._feed, name="test-feed")
        self.start_time = 0.0

    @property
    def uri(self) -> str:
        return f"vicon://127.0.0.1:{self._thread.server.vicon_port}?subject=cf1"

    @property
    def udp_uri(self) -> str:
        return f"vicon-udp://127.0.0.1:{self._thread.server.vicon_udp_port}?subject=cf1"

    @property
    def vicon_port(self) -> int:
        return self._thread.server.vicon_port

    def _feed(self) -> None:
        with FeedSender(self._thread.server.feed_port) as sender:
            while not self._stop.wait(0.002):
                if self.feeding.is_set():
                    now = time.monotonic() - self.start_time
                    sender.send(now, self._motion(now))

    def __enter__(self) -> Self:
        self._thread.__enter__()
        self.start_time = time.monotonic()
        self._feeder.start()
        return self

    def __exit__(self, *error: object) -> None:
        self._stop.set()
        self._feeder.join()
        self._thread.__exit__(None, None, None)
