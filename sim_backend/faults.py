"""Faults that the simulated lab shows on request: ``--fault NAME=VALUE``, one registry for all of them.

Names that start with ``mocap_`` belong to the room (:class:`sim_backend.room.settings.RoomFaults`), those
with ``bench_`` to the bench (:class:`sim_backend.bench.faults.BenchFaults`); both are passed on. All others
are the drone's. Times count from the start of the lab (world time, s).
"""

from collections.abc import Iterable

from sim_backend.bench.faults import BENCH_RULES
from sim_backend.fault_values import (
    CHANCE,
    TIME,
    FaultError,
    FaultRule,
    FaultRules,
    fault_values,
    integer,
    motor_pair,
    number,
    vector,
    window,
)
from sim_backend.lab_faults import DroneFaults, Faults
from sim_backend.room.settings import ROOM_RULES
from sim_backend.survey import ceiling_truth

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
    "motor_reversed": FaultRule(
        integer(1, 2, 3, 4), "N: motor N turns the wrong way, and its propeller lifts nothing"
    ),
    "hung_at": FaultRule(
        window(120.0), "S[:DURATION]: the drone hangs on a thread, free to turn, its propellers off"
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
