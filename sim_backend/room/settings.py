"""What a simulated room is like: cameras, ports, noise, and the faults it shall show."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Self

from onboard.errors import InputError
from sim_backend.errors import SimulationError
from sim_backend.fault_values import (
    CHANCE,
    TIME,
    FaultWindow,
    fault,
    fault_rules,
    fault_values,
    integer,
    number,
    window,
)


class RoomSettingsError(SimulationError, InputError):
    """A setting of the simulated room that cannot be used."""


class RoomError(SimulationError):
    """The simulated room cannot be served (a port is taken)."""


@dataclass(frozen=True, slots=True)
class RoomFaults:
    """Faults to show, each with what the command line takes, with the prefix ``mocap_``.

    Times are world time (s), as the feed carries it. The reported latency knows nothing of `jitter` (s).
    """

    freeze: FaultWindow | None = fault(
        window(), "S[:DURATION]: poses repeat exactly while frames go on", None, "freeze_at"
    )
    occlude: FaultWindow | None = fault(window(), "S[:DURATION]: no body is seen", None, "occlude_at")
    flip180: FaultWindow | None = fault(
        window(0.01),
        "S[:DURATION]: bodies appear turned half round about z (default: one frame)",
        None,
        "flip180_at",
    )
    drop: float = fault(CHANCE, "P: probability that a frame is never sent", 0.0)
    jitter: float = fault(
        number(0.0, scale=1e-3),
        "MS: extra network delay of each frame, uniform up to this",
        0.0,
        "jitter_ms",
    )
    dies_at: float | None = fault(TIME, "S: the room closes every connection", None)
    reflections: int = fault(
        integer(*range(1, 10)), "N: unlabelled markers on the floor that belong to nobody", 0
    )

    @classmethod
    def parse(cls, texts: Mapping[str, str]) -> Self:
        """Faults by their command-line names: ``{"mocap_freeze_at": "3.5", ...}``.

        Raises:
            FaultError: an unknown name or a value that cannot be used.
        """
        return cls(**fault_values(texts, ROOM_RULES))


ROOM_RULES = fault_rules(RoomFaults, "mocap_")
"""What each fault of the room takes and does, by name."""


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
        occlusion: probability that a body's fit fails in a frame: it is missing, its markers are unlabelled.
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
