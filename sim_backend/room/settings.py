"""What a simulated room is like: cameras, ports, noise, and the faults it shall show."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Self

from onboard.errors import InputError
from sim_backend.errors import SimulationError


class RoomSettingsError(SimulationError, InputError):
    """A setting or fault of the simulated room that cannot be used."""


class RoomError(SimulationError):
    """The simulated room cannot be served (a port is taken)."""


@dataclass(frozen=True, slots=True)
class Window:
    """A span of world time (s); `end` is infinite when the fault stays."""

    start: float
    end: float = math.inf

    def covers(self, world_time: float) -> bool:
        """Whether the fault is on at `world_time`."""
        return self.start <= world_time < self.end


@dataclass(frozen=True, slots=True)
class RoomFaults:
    """Faults to show. Times are world time (s), as the feed carries it.

    Attributes:
        freeze: poses repeat exactly while frames go on.
        occlude: all bodies are out of view.
        flip180: all bodies appear turned by 180 deg about their z axis, as after a marker swap.
        drop: probability that a frame is never sent.
        jitter: extra delay of each frame on the network, uniform in 0..jitter (s); not in the reported
        latency.
        dies_at: the room closes every connection and stops serving.
    """

    freeze: Window | None = None
    occlude: Window | None = None
    flip180: Window | None = None
    drop: float = 0.0
    jitter: float = 0.0
    dies_at: float | None = None

    @classmethod
    def parse(cls, faults: Mapping[str, str], frame_period: float = 0.01) -> Self:
        """Faults by their command-line names: ``{"mocap_freeze_at": "3.5", ...}``.

        ``mocap_freeze_at=S[:DURATION]``, ``mocap_occlude_at=S[:DURATION]``, ``mocap_flip180_at=S[:DURATION]``
        (without a duration: one frame), ``mocap_drop=P``, ``mocap_jitter_ms=MS``, ``mocap_dies_at=S``.

        Raises:
            RoomSettingsError: an unknown name or a value that cannot be used.
        """
        unknown = sorted(set(faults) - set(FAULT_NAMES))
        if unknown:
            raise RoomSettingsError(f"unknown mocap fault {unknown[0]!r}; known: {', '.join(FAULT_NAMES)}")
        drop = _number(faults, "mocap_drop", 0.0)
        if drop > 1.0:
            raise RoomSettingsError(f"mocap_drop={faults['mocap_drop']}: a probability is 0..1")
        return cls(
            freeze=_window(faults, "mocap_freeze_at", math.inf),
            occlude=_window(faults, "mocap_occlude_at", math.inf),
            flip180=_window(faults, "mocap_flip180_at", frame_period),
            drop=drop,
            jitter=_number(faults, "mocap_jitter_ms", 0.0) / 1000.0,
            dies_at=_number(faults, "mocap_dies_at", 0.0) if "mocap_dies_at" in faults else None,
        )


FAULT_NAMES = (
    "mocap_freeze_at",
    "mocap_occlude_at",
    "mocap_flip180_at",
    "mocap_drop",
    "mocap_jitter_ms",
    "mocap_dies_at",
)


def _number(faults: Mapping[str, str], name: str, missing: float) -> float:
    return _parse(name, faults[name]) if name in faults else missing


def _window(faults: Mapping[str, str], name: str, duration: float) -> Window | None:
    if name not in faults:
        return None
    start, colon, length = faults[name].partition(":")
    begin = _parse(name, start)
    return Window(begin, begin + (_parse(name, length) if colon else duration))


def _parse(name: str, text: str) -> float:
    try:
        value = float(text)
    except ValueError as error:
        raise RoomSettingsError(f"{name}={text!r}: not a number") from error
    if not math.isfinite(value) or value < 0.0:
        raise RoomSettingsError(f"{name}={text}: must be a number of at least 0")
    return value


@dataclass(frozen=True, slots=True)
class RoomSettings:
    """A simulated room.

    Attributes:
        subjects: names of the bodies the room knows, in order.
        rate_hz: camera frame rate (Hz).
        latency: from exposure to sending (s); LatencyInfo reports what it really was.
        position_noise: standard deviation per axis (m); real Vicon: 14-21 um static
            (NanoBench flights, measured).
        rotation_noise: standard deviation per axis (rad); 0.2 mrad in the same flights.
        occlusion: probability that a body is missing from a frame.
        host: local address of all sockets.
        vicon_port: TCP port of the DataStream server; 0 takes a free one.
        vicon_udp_port: UDP port that the Tracker object stream is sent to; 0 takes a free one.
        udp_block_size: datagram size of the object stream, 256, 512 or 1024.
        feed_port: UDP port on which true poses arrive; 0 takes a free one.
        feed_timeout: bodies vanish when the feed has been silent for this long (s).
        faults: what goes wrong, and when.
    """

    subjects: tuple[str, ...] = ("cf1",)
    rate_hz: float = 100.0
    latency: float = 0.004
    position_noise: float = 17e-6
    rotation_noise: float = 0.2e-3
    occlusion: float = 0.0
    host: str = "127.0.0.1"
    vicon_port: int = 18801
    vicon_udp_port: int = 51001
    udp_block_size: int = 1024
    feed_port: int = 0
    feed_timeout: float = 0.05
    faults: RoomFaults = field(default_factory=RoomFaults)

    def __post_init__(self) -> None:
        if not 1.0 <= self.rate_hz <= 2000.0:
            raise RoomSettingsError(f"camera rate {self.rate_hz} Hz is outside 1..2000")
        if len(set(self.subjects)) != len(self.subjects) or not all(self.subjects):
            raise RoomSettingsError(f"subjects {self.subjects}: names must be different and not empty")
        if any(len(name.encode()) > 23 for name in self.subjects):
            raise RoomSettingsError(
                f"subjects {self.subjects}: a name longer than 23 bytes would be cut on UDP"
            )

    @property
    def period(self) -> float:
        """Time between frames (s)."""
        return 1.0 / self.rate_hz
