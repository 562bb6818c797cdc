"""Triggers that do not come in the simulated drone: does the brake meet the ceiling, and what becomes of it?

    python benchmarks/missed_triggers.py [--speeds 1.5,2,2.5] [--angles 50,60,88] [--seeds 2]

The shipped policy flies with an intercept that keeps it from firing; its range of tau, below which the drone
brakes, stays. The flights are those of the simulated lab without its sockets and clock. Prints one JSON
document; `met_with_m_s` is the climb at which the ceiling was met, null where it was not, and `fell` whether
the motors were cut before the drone was down.
"""

import argparse
import dataclasses
import json
import sys
from pathlib import Path
from typing import Any

import numpy as np

from onboard.app_interface import LandingState, Parameter
from onboard.policy.bundle import encode_bundle
from onboard.policy.files import find_policy, load_policy
from onboard.room import RoomGeometry
from onboard.trajectory import ApproachError, ApproachPlan, fit_approach

sys.path.insert(0, str(Path(__file__).parents[1]))

from tests.sim_crazyflie.simulated_flight import Flight

NEVER = np.float32(-1e3)
"""Intercept of a policy that does not fire."""

BRAKES = (LandingState.BRAKE, LandingState.HOLD)


def fly(plan: ApproachPlan, bundle: bytes, seed: int) -> dict[str, Any]:
    """One approach, its brake and the landing after it."""
    flight = Flight(seed)
    flight.upload(bundle)
    flight.set_plan(plan)
    flight.fly_to_start(plan)
    for name in (Parameter.POLICY_ARM, Parameter.TRAJECTORY_ARM, Parameter.GO):
        flight.write(name, 1)
    truth, closest, climb, met = flight.drone.state, np.inf, 0.0, None
    ended = (LandingState.HOLD, LandingState.CUT)
    for _ in range(6000):
        state = LandingState(int(flight.log("perch.state")))
        if state in BRAKES:
            closest = min(closest, plan.ceiling_z - float(truth["position"][2]))
            met = climb if met is None and truth["ceiling_contact"] else met
        if state in ended and truth["velocity"][2] < 0.0:
            break
        climb = float(truth["velocity"][2])
        flight.tick()
    flight.write(Parameter.POLICY_ARM, 0)
    flight.write(Parameter.TRAJECTORY_ARM, 0)
    flight.run(2.0, until=lambda: flight.log("perch.state") == LandingState.IDLE)
    flight.land(3.0)
    flight.run(5.0, until=lambda: flight.position[2] < 0.2 or not flight.info.can_fly)
    return {
        "climb_m_s": plan.vz,
        "closest_m": closest,
        "met_with_m_s": met,
        "fell": not flight.info.can_fly,
    }


def numbers(text: str) -> list[float]:
    """Of a list with commas."""
    return [float(word) for word in text.split(",")]


def main() -> None:
    """Fly and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--speeds", type=numbers, default="1.5,1.75,2,2.25,2.5,2.75,3", help="m/s")
    parser.add_argument("--angles", type=numbers, default="50,60,88", help="deg")
    parser.add_argument("--seeds", type=int, default=2, help="flights of each, with other noise")
    arguments = parser.parse_args()
    policy = load_policy(find_policy("default"))
    bundle = encode_bundle(dataclasses.replace(policy, intercept=NEVER))
    rows = []
    for angle in arguments.angles:
        for speed in arguments.speeds:
            try:
                plan = fit_approach(speed, angle, RoomGeometry())
            except ApproachError:  # the room is too low or too short for it
                continue
            for seed in range(arguments.seeds):
                rows.append({"speed_m_s": speed, "angle_deg": angle, **fly(plan, bundle, seed)})
    met = [row for row in rows if row["met_with_m_s"] is not None]
    document = {
        "benchmark": "missed_triggers",
        "flights": len(rows),
        "met_the_ceiling": len(met),
        "least_climb_that_met_it_m_s": min((row["climb_m_s"] for row in met), default=None),
        "fell": sum(row["fell"] for row in rows),
        "attempts": rows,
    }
    print(json.dumps(document, indent=1))


if __name__ == "__main__":
    main()
