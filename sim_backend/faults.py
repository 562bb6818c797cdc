"""Faults that the simulated lab shows on request: ``--fault NAME=VALUE``, one registry for all of them.

Names that start with ``mocap_`` belong to the room (:class:`sim_backend.room.settings.RoomFaults`), those
with ``bench_`` to the bench (:class:`sim_backend.bench.faults.BenchFaults`); both are passed on. All others
are the drone's. Times count from the start of the lab (world time, s).
"""

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

from sim_backend.bench.faults import BENCH_RULES
from sim_backend.fault_values import (
    CHANCE,
    NO_TIME,
    TIME,
    FaultError,
    FaultRule,
    FaultRules,
    Window,
    fault_values,
    integer,
    motor_pair,
    number,
    vector,
    window,
)
from sim_backend.room.settings import ROOM_RULES
from sim_backend.survey import CeilingTruth, ceiling_truth


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
        motors_swapped: two motors (1..4) whose connectors are exchanged.
        propeller_reversed: motor (1..4) with the wrong kind of propeller, which lifts nothing; 0: none.
        survey_at: a person surveys the room from then on (:mod:`sim_backend.survey`).
        survey_ceiling: the plane that is touched then; None: the room's.
        held_at: while a person holds the drone: half of the time nose down, then left side down, by 30 deg.
    """

    battery_voltage: float | None = None
    link_loss: float = 0.0
    freeze_drone_at: float = math.inf
    drone_dies_at: float = math.inf
    gyro_bias: tuple[float, float, float] = (0.0, 0.0, 0.0)
    policy_weight: float = 1.0
    motors_swapped: tuple[int, int] | None = None
    propeller_reversed: int = 0
    held_at: Window = NO_TIME
    survey_at: Window = NO_TIME
    survey_ceiling: CeilingTruth | None = None


@dataclass(frozen=True, slots=True)
class Faults:
    """The faults of a lab: of its drones, and those to hand to the room and to the bench as text."""

    drone: DroneFaults = field(default_factory=DroneFaults)
    room: Mapping[str, str] = field(default_factory=dict)
    bench: Mapping[str, str] = field(default_factory=dict)


_DRONE_RULES: FaultRules = {
    "battery_voltage": FaultRule(number(2.0, 4.35), "V: open-circuit voltage of every fresh pack"),
    "link_loss": FaultRule(CHANCE, "P: probability that a packet is lost, each way"),
    "freeze_drone_at": FaultRule(TIME, "S: the firmware hangs and answers nothing any more"),
    "drone_dies_at": FaultRule(TIME, "S: the drone loses its power"),
    "policy_weight": FaultRule(
        number(0.0, 2.0), "F: one weight of each policy that goes live is F times what it was"
    ),
    "motors_swapped": FaultRule(motor_pair, "A,B: the connectors of motors A and B (1 to 4) are exchanged"),
    "propeller_reversed": FaultRule(
        integer(1, 2, 3, 4), "N: the propeller of motor N is of the other direction and lifts nothing"
    ),
    "held_at": FaultRule(
        window(2.0), "S[:DURATION]: a person holds the drone, nose down, then left side down, by 30 deg"
    ),
    "survey_at": FaultRule(
        window(4.0),
        "S[:DURATION]: a person turns the drone by half a turn, then touches the ceiling at four points "
        "with the subject 'wand', each for DURATION",
    ),
    "survey_ceiling": FaultRule(
        ceiling_truth, "H,X,Y: height and tilts along x and y (m, deg) of the ceiling that is touched"
    ),
    "gyro_bias": FaultRule(vector, "X,Y,Z: bias of the gyro after its calibration, rad/s"),
}


def fault_table() -> dict[str, str]:
    """What each fault takes and does, by name."""
    rules = {**_DRONE_RULES, **ROOM_RULES, **BENCH_RULES}
    return {name: rule.meaning for name, rule in rules.items()}


def parse_faults(arguments: Iterable[str]) -> Faults:
    """The faults of command-line arguments ``NAME=VALUE``.

    Raises:
        FaultError: not of that form, unknown name, or a value that cannot be used.
    """
    drone: dict[str, str] = {}
    room: dict[str, str] = {}
    bench: dict[str, str] = {}
    for argument in arguments:
        name, equals, value = argument.partition("=")
        if not equals:
            raise FaultError(f"--fault {argument}: write NAME=VALUE")
        owner = room if name in ROOM_RULES else bench if name in BENCH_RULES else drone
        owner[name] = value
    if unknown := drone.keys() - _DRONE_RULES.keys():
        known = ", ".join(fault_table())
        raise FaultError(f"--fault {min(unknown)}: no fault of this name; known: {known}")
    return Faults(DroneFaults(**fault_values(drone, _DRONE_RULES)), room, bench)
