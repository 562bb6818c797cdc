"""Faults that the simulated lab shows on request: ``--fault NAME=VALUE``, one registry for all of them.

Names that start with ``mocap_`` belong to the room (:class:`sim_backend.room.settings.RoomFaults`), those
with ``bench_`` to the bench (:class:`sim_backend.bench.faults.BenchFaults`); both are passed on. All others
are the drone's. Times count from the start of the lab (world time, s).
"""

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field

from onboard.errors import InputError
from sim_backend.bench.faults import BENCH_HELP
from sim_backend.bench.faults import PREFIX as BENCH_PREFIX
from sim_backend.errors import SimulationError

ROOM_PREFIX = "mocap_"


class FaultError(SimulationError, InputError):
    """A fault that does not exist or has a value that cannot be used."""


@dataclass(frozen=True, slots=True)
class DroneFaults:
    """What goes wrong with every drone of the lab.

    Attributes:
        battery_voltage: open-circuit voltage of each fresh pack, V (None: full).
        link_loss: probability that a packet is lost, each way.
        freeze_drone_at: the firmware stops and answers nothing any more; the motors keep their command.
        drone_dies_at: the drone loses its power at this time: motors off, radio silent.
        gyro_bias: bias that the gyro develops after its calibration, about x, y, z, rad/s.
        policy_weight: factor of one weight of each policy that goes live, which no checksum shows.
    """

    battery_voltage: float | None = None
    link_loss: float = 0.0
    freeze_drone_at: float = math.inf
    drone_dies_at: float = math.inf
    gyro_bias: tuple[float, float, float] = (0.0, 0.0, 0.0)
    policy_weight: float = 1.0


@dataclass(frozen=True, slots=True)
class Faults:
    """The faults of a lab: of its drones, and those to hand to the room and to the bench as text."""

    drone: DroneFaults = field(default_factory=DroneFaults)
    room: Mapping[str, str] = field(default_factory=dict)
    bench: Mapping[str, str] = field(default_factory=dict)


def _number(low: float, high: float) -> Callable[[str], float]:
    def parse(text: str) -> float:
        value = float(text)
        if not low <= value <= high:
            raise ValueError(f"must be between {low:g} and {high:g}")
        return value

    return parse


def _vector(text: str) -> tuple[float, float, float]:
    parts = [float(part) for part in text.split(",")]
    if len(parts) != 3 or not all(math.isfinite(part) for part in parts):
        raise ValueError("must be three numbers X,Y,Z")
    return (parts[0], parts[1], parts[2])


_PARSERS: dict[str, tuple[Callable[[str], object], str]] = {
    "battery_voltage": (_number(2.0, 4.35), "V: open-circuit voltage of every fresh pack"),
    "link_loss": (_number(0.0, 1.0), "P: probability that a packet is lost, each way"),
    "freeze_drone_at": (_number(0.0, math.inf), "S: the firmware hangs and answers nothing any more"),
    "drone_dies_at": (_number(0.0, math.inf), "S: the drone loses its power"),
    "policy_weight": (
        _number(0.0, 2.0),
        "F: one weight of each policy that goes live is F times what it was",
    ),
    "gyro_bias": (_vector, "X,Y,Z: bias of the gyro after its calibration, rad/s"),
}

_ROOM_HELP = {
    "mocap_freeze_at": "S[:DURATION]: poses repeat exactly while frames go on",
    "mocap_occlude_at": "S[:DURATION]: no body is seen",
    "mocap_flip180_at": "S[:DURATION]: bodies appear turned half round about z (default: one frame)",
    "mocap_drop": "P: probability that a frame is never sent",
    "mocap_jitter_ms": "MS: extra network delay of each frame, uniform up to this",
    "mocap_dies_at": "S: the room closes every connection",
}


def fault_table() -> dict[str, str]:
    """What each fault takes and does, by name."""
    return {name: text for name, (_, text) in _PARSERS.items()} | _ROOM_HELP | BENCH_HELP


def parse_faults(arguments: Iterable[str]) -> Faults:
    """The faults of command-line arguments ``NAME=VALUE``.

    Raises:
        FaultError: not of that form, unknown name, or a value that cannot be used.
    """
    drone: dict[str, object] = {}
    room: dict[str, str] = {}
    bench: dict[str, str] = {}
    for argument in arguments:
        name, equals, value = argument.partition("=")
        if not equals:
            raise FaultError(f"--fault {argument}: write NAME=VALUE")
        if name.startswith(ROOM_PREFIX):
            room[name] = value
            continue
        if name.startswith(BENCH_PREFIX):
            bench[name] = value
            continue
        if name not in _PARSERS:
            known = ", ".join(fault_table())
            raise FaultError(f"--fault {argument}: no fault named {name!r}; known: {known}")
        try:
            drone[name] = _PARSERS[name][0](value)
        except ValueError as error:
            raise FaultError(f"--fault {argument}: {error} ({name}={_PARSERS[name][1]})") from error
    return Faults(DroneFaults(**drone), room, bench)  # type: ignore[arg-type] # as its parser gives it
