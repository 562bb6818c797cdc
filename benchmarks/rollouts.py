"""Speed of the physics and of landing attempts beside crazyflow and MuJoCo. Prints one JSON document.

    python benchmarks/rollouts.py [--seconds 1.0] [--workers N] [--peers PYTHON]

Free flight counts steps of 1 kHz with the geometric controller and mixer at 500 Hz, and without, on one
core. `with_every_effect` is the same flight with all terms of docs/physics.md, Effects, switched on at
typical values (of two that exclude each other, one). Contact counts steps of a vehicle that hangs on four
legs and swings. A landing is a complete attempt from the placement to half a second after the contact.
Median and best of five repeats by wall time, and the median by processor time, which a busy machine
disturbs less. Compilation is not in these figures; `first_call_s` has it when the cache is cold.

PYTHON is an interpreter whose packages include crazyflow and mujoco (a virtual environment of its own).
Peers and we take turns, repeat by repeat. Ratios are of medians: free flight with controller on one core
against crazyflow's best case on all cores; contact against MuJoCo's four-legged vehicle, both on one
core; `cost_of_every_effect` is time with them over time without. Without PYTHON the peers are reported as
not measured.
"""

import argparse
import dataclasses
import json
import math
import os
import sys
import time
from collections.abc import Callable
from importlib.metadata import version
from typing import Any

import numpy as np
from machine import machine
from numba import njit
from peer_process import PeerProcess, rates

from onboard.controller import ControllerGains
from onboard.quantity import Quantity
from onboard.room import RoomGeometry
from onboard.vehicle import Effect, Vehicle
from onboard.vehicle.effects import EFFECTS
from perchhw.learning.executor import LocalThreads
from perchhw.learning.grid import Condition, generator
from perchhw.learning.setup import LearningSetup
from perchhw.learning.trial import Rules, fly, new_bench
from sim_backend.physics.decision import ThresholdPolicy
from sim_backend.physics.motors import decay
from sim_backend.physics.parameters import physics_parameters
from sim_backend.physics.reset import approaching
from sim_backend.physics.rollout import hold_velocity
from sim_backend.physics.step import advance

REPEATS = 5
DT = 1e-3
FLIGHT = 1000
"""Steps of one free flight."""


@njit(cache=True, nogil=True)
def free_flight(states: Any, parameters: Any, gains: ControllerGains, control_steps: int, steps: int) -> None:
    """`steps` steps far from any surface; the controller runs every `control_steps`, never for 0."""
    p = parameters[0]
    up, down = decay(p, 0.5 * DT)
    hover = 0.25 * p.mass * p.gravity
    for k in range(len(states)):
        targets = (hover, hover, hover, hover)
        lagged = (0.0, 0.0, 0.0)
        held = (1.0, 0.0, 0.5)
        for i in range(steps):
            if control_steps > 0 and i % control_steps == 0:
                targets, lagged = hold_velocity(
                    states[k], p, states[k].velocity, held, gains, lagged, control_steps * DT
                )
            advance(states[k], p, targets, DT, up, down)


@njit(cache=True)
def hanging(states: Any, parameters: Any, steps: int) -> None:
    """`steps` steps of attached vehicles with their motors off."""
    p = parameters[0]
    up, down = decay(p, 0.5 * DT)
    for k in range(len(states)):
        for _ in range(steps):
            advance(states[k], p, (0.0, 0.0, 0.0, 0.0), DT, up, down)


def repeat(work: Callable[[], float]) -> dict[str, float]:
    """One repeat of `work`, which returns how many units it did."""
    started, used = time.perf_counter(), time.process_time()
    steps = work()
    return {
        "steps": steps,
        "wall_s": time.perf_counter() - started,
        "cpu_s": time.process_time() - used,
    }


def with_every_effect(vehicle: Vehicle) -> Vehicle:
    """The vehicle with all effects at typical values, the motors' speed law instead of what it excludes."""
    chosen: dict[str, Effect] = {}
    for name in sorted(EFFECTS, key=lambda name: name != "motor_speed_law"):
        description = EFFECTS[name]
        if any(other in chosen for other in description.excludes):
            continue
        parameters = {
            parameter: Quantity(rule.typical, rule.unit, 0.0, "benchmark")
            for parameter, rule in description.parameters.items()
        }
        chosen[name] = Effect(name=name, parameters=parameters)
    return dataclasses.replace(vehicle, effects=tuple(chosen.values()))


def flying(parameters: Any, count: int) -> np.ndarray:
    """Vehicles in flight at a height where a second takes them to no surface."""
    state = approaching(parameters, np.array([0.0, 0.0, 3.0]), np.array([1.0, 0.0, 0.5]))
    state["omega"] = [0.1, 1.0, 0.2]
    return np.repeat(np.array(state).reshape(1), count)


def landed(parameters: Any, rules: Rules) -> np.ndarray:
    """A vehicle that has just swung onto four legs."""
    bench = new_bench(parameters, 1)
    rng = np.random.default_rng(0)
    fly(rng, bench, 0, ThresholdPolicy(0.23, -7e-3), 2.5, math.radians(40.0), rules)
    if bench.outs[0]["feet"] != 4:
        sys.exit("the landing of the benchmark did not attach four legs")
    return bench.state


def landings(parameters: Any, rules: Rules, count: int, workers: int) -> float:
    """Fly `count` attempts over the grid's range on `workers` threads."""
    chunks = [Condition(1.5 + 2.0 * k / 16, 30.0 + 60.0 * ((7 * k) % 17) / 17) for k in range(16)]
    each = math.ceil(count / len(chunks))

    def work(condition: Condition) -> int:
        bench, rng = new_bench(parameters, 1), generator(0, 9, condition)
        for _ in range(each):
            policy = ThresholdPolicy(float(rng.uniform(0.2, 0.26)), -float(rng.uniform(4e-3, 9e-3)))
            fly(rng, bench, 0, policy, condition.speed, math.radians(condition.angle_deg), rules)
        return each

    return float(sum(done for _, done in LocalThreads(workers).spread(work, chunks)))


def our_cases(seconds: float, workers: int) -> dict[str, Callable[[], float]]:
    """What is measured of ours; each repeat takes about `seconds`. Compiles everything."""
    setup = LearningSetup(vehicle="crazyflie21-upgraded-stored")
    parameters, rules = setup.load()
    sky = np.array(parameters).reshape(1).copy()
    every = physics_parameters(with_every_effect(setup.load_vehicle()), RoomGeometry())
    thick_air = np.array(every).reshape(1).copy()
    sky["ceiling_z"] = thick_air["ceiling_z"] = 1e9
    room = np.array(parameters).reshape(1)
    attached = landed(parameters, rules)
    free_flight(flying(sky[0], 1), sky, rules.gains, 2, 2)
    hanging(attached.copy(), room, 2)
    flights, contact, attempts = int(8e3 * seconds), int(2e5 * seconds), int(1000 * seconds)

    def fly_free(where: np.ndarray, control_steps: int) -> float:
        free_flight(flying(where[0], flights), where, rules.gains, control_steps, FLIGHT)
        return float(flights * FLIGHT)

    def fly_free_everywhere() -> float:
        shares = LocalThreads(workers).spread(lambda _: fly_free(sky, 2), range(workers))
        return sum(done for _, done in shares)

    def hang() -> float:
        for _ in range(100):
            hanging(attached.copy(), room, contact // 100)
        return float(contact)

    return {
        "free_flight_with_controller_steps_per_s": lambda: fly_free(sky, 2),
        "free_flight_with_controller_all_workers_steps_per_s": fly_free_everywhere,
        "free_flight_steps_per_s": lambda: fly_free(sky, 0),
        "free_flight_with_controller_with_every_effect_steps_per_s": lambda: fly_free(thick_air, 2),
        "contact_steps_per_s": hang,
        "landings_per_s_one_core": lambda: landings(parameters, rules, attempts, 1),
        "landings_per_s": lambda: landings(parameters, rules, attempts * workers, workers),
    }


def ratios(
    ours: dict[str, dict[str, float]], crazyflow: Any, mujoco: Any, figure: str
) -> dict[str, float | None]:
    """Ours over theirs in a figure of :func:`rates`, None where the peer was not measured."""
    flight = ours["free_flight_with_controller_steps_per_s"][figure]
    contact = ours["contact_steps_per_s"][figure]
    every_effect = ours["free_flight_with_controller_with_every_effect_steps_per_s"][figure]
    result: dict[str, float | None] = {
        "cost_of_every_effect": flight / every_effect,
        "free_flight_with_controller_vs_crazyflow_best": None,
        "free_flight_with_controller_all_workers_vs_crazyflow_best": None,
        "contact_vs_mujoco_pressed_per_core": None,
        "contact_vs_mujoco_hanging_per_core": None,
    }
    if crazyflow["measured"]:
        best = max(case[figure] for case in crazyflow["steps_per_s"].values())
        together = ours["free_flight_with_controller_all_workers_steps_per_s"][figure]
        result["free_flight_with_controller_vs_crazyflow_best"] = flight / best
        result["free_flight_with_controller_all_workers_vs_crazyflow_best"] = together / best
    if mujoco["measured"]:
        for case in ("pressed", "hanging"):
            rival = mujoco["steps_per_s"][case][figure]
            result[f"contact_vs_mujoco_{case}_per_core"] = contact / rival
    return result


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--seconds", type=float, default=1.0, help="about how long one repeat takes")
    parser.add_argument("--workers", type=int, default=os.cpu_count() or 1)
    parser.add_argument("--peers", metavar="PYTHON", help="interpreter that has crazyflow and mujoco")
    arguments = parser.parse_args()
    started = time.perf_counter()
    cases = our_cases(arguments.seconds, arguments.workers)
    first_call = time.perf_counter() - started
    repeats: dict[str, list[dict[str, float]]] = {name: [] for name in cases}
    with (
        PeerProcess(arguments.peers, "crazyflow_flight.py", arguments.seconds) as crazyflow,
        PeerProcess(arguments.peers, "mujoco_legs.py", arguments.seconds) as mujoco,
    ):
        for _ in range(REPEATS):
            for name, work in cases.items():
                repeats[name].append(repeat(work))
            crazyflow.turn()
            mujoco.turn()
    ours = {name: rates(list_of) for name, list_of in repeats.items()}
    peers = {"crazyflow": crazyflow.result(), "mujoco": mujoco.result()}
    document = {
        "benchmark": "rollouts",
        **ours,
        "peers": peers,
        "ratios": ratios(ours, peers["crazyflow"], peers["mujoco"], "median"),
        "ratios_per_cpu_s": ratios(ours, peers["crazyflow"], peers["mujoco"], "median_per_cpu_s"),
        "workers": arguments.workers,
        "first_call_s": first_call,
        "load_average": os.getloadavg()[0],
        **machine(),
        "versions": {package: version(package) for package in ("numba", "numpy")},
    }
    print(json.dumps(document, indent=1))


if __name__ == "__main__":
    main()
