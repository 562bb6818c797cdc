"""crazyflow on the CPU: free flight with its attitude controller, first-principles dynamics, 500 Hz.

Takes turns with our own measurement (see turns.py). A step is one physics step of one drone; the worlds of a
case and the steps of a call are chosen so that its best is among them.

    python crazyflow_flight.py SECONDS
"""

import os

os.environ["JAX_PLATFORMS"] = "cpu"

import sys
import time
from collections.abc import Callable

import jax
import numpy as np
from crazyflow.sim import Sim
from turns import take_turns

CASES = ((1000, 100), (2000, 100), (10_000, 20))
"""Worlds, steps in a call."""

FREQUENCY = 500
THRUST = 0.3  # N, constant attitude command


def build(worlds: int, steps: int) -> Callable[[float], int]:
    """A simulation that runs for about so many seconds and returns its steps."""
    sim = Sim(
        n_worlds=worlds,
        n_drones=1,
        dynamics="first_principles",
        control="attitude",
        drone="cf2x_L250",
        freq=FREQUENCY,
        attitude_freq=FREQUENCY,
        device="cpu",
    )
    command = np.zeros((worlds, 1, 4))
    command[..., 3] = THRUST

    def run(seconds: float) -> int:
        calls, started = 0, time.perf_counter()
        while calls == 0 or time.perf_counter() - started < seconds:
            sim.attitude_control(command)
            sim.step(steps)
            jax.block_until_ready(sim.data.states.pos)
            calls += 1
        return calls * steps * worlds

    return run


def main() -> None:
    """Build the cases and take turns."""
    seconds = float(sys.argv[1])
    runs = {f"{worlds}_worlds": build(worlds, steps) for worlds, steps in CASES}
    take_turns(
        {name: lambda run=run: run(seconds) for name, run in runs.items()}, ("crazyflow", "jax", "mujoco")
    )


if __name__ == "__main__":
    main()
