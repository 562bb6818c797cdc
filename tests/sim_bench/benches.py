"""Vehicles and benches for these tests."""

import dataclasses
import functools
from typing import Any

from onboard.quantity import Quantity
from onboard.vehicle import Effect, Vehicle, load_vehicle
from sim_backend.bench.bench import Bench, BenchOptions
from sim_backend.bench.faults import BenchFaults
from sim_backend.bench.operator import SimulatedOperator
from sim_backend.lab_faults import DroneFaults

STRINGS = {"string_distance_top": 0.06, "string_distance_bottom": 0.06, "string_length": 0.6}
HANG_Z = {"do": "hang", "axis": [0, 0, 1], **STRINGS}


@functools.cache
def vehicle() -> Vehicle:
    """First-order thrust, no effects."""
    return load_vehicle("crazyflie21-upgraded", None)


def vehicle_with_speed_law() -> Vehicle:
    """The motors of the authors' tachometer logs."""
    law = {
        "a_up": (0.0, "1/s"),
        "b_up": (4.24e-3, "1/rad"),
        "a_down": (0.5, "1/s"),
        "b_down": (1.78e-3, "1/rad"),
    }
    parameters = {name: Quantity(value, unit, 0.0, "test") for name, (value, unit) in law.items()}
    return dataclasses.replace(vehicle(), effects=(Effect(name="motor_speed_law", parameters=parameters),))


class Stand:
    """A bench with its operator, in this process."""

    def __init__(self, seed: int = 0, drone: DroneFaults | None = None, **faults: Any) -> None:
        options = BenchOptions(seed, BenchFaults(**faults), drone or DroneFaults())
        self.bench = Bench(vehicle(), options)
        self.operator = SimulatedOperator(self.bench, lambda name: f"/dev/new-{name}")

    def say(self, **request: Any) -> dict[str, Any]:
        """One request, and the bench time that it takes."""
        reply = self.operator.perform(request)
        self.bench.run(reply.at - self.bench.time)
        return reply.document

    def command(self, *ratios: int) -> None:
        """What a client's ``motorPowerSet`` parameters would do: m1 to m4, 0..65535."""
        values = [1, *ratios] if any(ratios) else [0, 0, 0, 0, 0]
        self.bench.firmware.motor_override[:] = values

    def supply(self, *commands: str) -> list[str]:
        """Tell the supply something; its answers."""
        text = "".join(f"{command}\n" for command in commands).encode()
        return self.bench.scpi.receive(text).decode().splitlines()
