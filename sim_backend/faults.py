"""Faults that the simulated lab shows on request: ``--fault NAME=VALUE``, one registry for all of them.

Names that start with ``mocap_`` belong to the room (:class:`sim_backend.room.settings.RoomFaults`), those
with ``bench_`` to the bench (:class:`sim_backend.bench.faults.BenchFaults`); both are passed on. All others
are the drone's. Times count from the start of the lab (world time, s).
"""

from collections.abc import Iterable

from sim_backend.bench.faults import BENCH_RULES
from sim_backend.fault_values import FaultError, fault_rules, fault_values
from sim_backend.lab_faults import DroneFaults, Faults
from sim_backend.room.settings import ROOM_RULES

_DRONE_RULES = fault_rules(DroneFaults)


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
