"""A room whose samples are judged: the health under test, a clock, and a frame number."""

import math

import numpy as np

from mocap_bridge.health import HealthLimits, PoseHealth, PoseVerdict
from mocap_bridge.pose import PoseSample
from mocap_bridge.rotation import Quaternion, Vector

IDENTITY = (0.0, 0.0, 0.0, 1.0)
HALF_TURNS = [(1.0, 0.0, 0.0, 0.0), (0.0, 1.0, 0.0, 0.0), (0.0, 0.0, 1.0, 0.0)]
PLACE = (1.0, 2.0, 1.5)
NOISE = np.random.default_rng(5).normal(scale=17e-6, size=(4000, 3))


def pitched(angle: float) -> Quaternion:
    return (0.0, math.sin(angle / 2), 0.0, math.cos(angle / 2))


class Room:
    """Produces samples for a health under test, by default at 100 Hz; keeps the frame number and the time."""

    def __init__(self, in_flight: bool = True, limits: HealthLimits | None = None) -> None:
        limits = limits or HealthLimits()
        self.now = 50.0
        self.frame = 0
        self.period = limits.frame_period
        self.health = PoseHealth(limits, lambda: self.now)
        self.health.in_flight = in_flight

    def skip(self, frames: int = 1) -> None:
        self.frame += frames
        self.now += self.period * frames

    def show(
        self,
        position: Vector | None = PLACE,
        quaternion: Quaternion | None = IDENTITY,
        *,
        noisy: bool = True,
        age: float = 0.005,
        frames: int = 1,
        elapsed: float | None = None,
    ) -> PoseVerdict:
        """One more sample, `frames` and `elapsed` s (by default as many periods) after the last one."""
        self.frame += frames
        self.now += self.period * frames if elapsed is None else elapsed
        if position is not None and noisy:
            dx, dy, dz = NOISE[self.frame % len(NOISE)].tolist()
            position = (position[0] + dx, position[1] + dy, position[2] + dz)
        sample = PoseSample(
            subject="cf1",
            frame=self.frame,
            capture_time=self.now - age,
            receipt_time=self.now,
            position=position,
            quaternion=quaternion,
            occluded=position is None,
            quality=1.0,
            latency=0.004,
        )
        return self.health.observe(sample)

    def lock(self, *, noisy: bool = True, age: float = 0.005) -> "Room":
        for _ in range(10):
            self.show(noisy=noisy, age=age)
        assert self.health.verdict() is PoseVerdict.OK
        return self
