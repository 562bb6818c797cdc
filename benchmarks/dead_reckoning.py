"""How far the simulated drone's estimate goes astray in brakes and holds without poses. One JSON document.

    python benchmarks/dead_reckoning.py [--gyro-bias 0.02]

Poses are lost in approaches of 1.5 to 3.5 m/s, 0.5, 0.7 and 0.9 s before the ceiling would be met; the drone
brakes and then holds until the end. Errors are those of the estimate against the truth, the largest of all
flights; `from_setpoint_m` is how far the estimate was from the hold's setpoint. The flights are those of the
simulated lab without its sockets and clock.
"""

import argparse
import json
import sys
from pathlib import Path
from typing import Any

import numpy as np

from onboard.app_interface import LandingState, Parameter
from onboard.room import RoomGeometry
from onboard.trajectory import ApproachError, ApproachPlan, fit_approach

sys.path.insert(0, str(Path(__file__).parents[1]))

from sim_backend.lab_faults import DroneFaults
from tests.sim_crazyflie.simulated_flight import Flight

BLIND_S = (0.0, 0.15, 0.5, 1.0, 2.0, 3.0, 3.5)
LOST_BEFORE_IMPACT_S = (0.5, 0.7, 0.9)
SPEEDS = (1.5, 2.0, 2.5, 3.0, 3.5)
ANGLES = (60.0, 50.0, 40.0, 30.0)


def steepest(speed: float) -> ApproachPlan:
    """The steepest approach of that speed (m/s) that the room has place for."""
    for angle in ANGLES:
        try:
            return fit_approach(speed, angle, RoomGeometry())
        except ApproachError:
            continue
    raise ApproachError(f"no approach at {speed} m/s fits the room")


def fly(plan: ApproachPlan, left: float, seed: int, bias: float) -> list[dict[str, float]]:
    """Errors of one brake and hold after each of `BLIND_S`; poses are lost `left` s before the ceiling."""
    flight = Flight(seed, faults=DroneFaults(gyro_bias=(bias, bias, bias)))
    flight.set_plan(plan)
    flight.fly_to_start(plan)
    for name in (Parameter.TRAJECTORY_ARM, Parameter.GO):
        flight.write(name, 1)
    flight.run(plan.impact_time - left)
    flight.poses = False
    rows, passed = [], 0.0
    for blind in BLIND_S:
        flight.run(blind - passed)
        passed = blind
        estimator, truth = flight.firmware.estimator, flight.drone.state
        here = np.array(estimator.position())
        holds = flight.log("perch.state") == LandingState.HOLD
        rows.append(
            {
                "position_m": float(np.linalg.norm(here - truth["position"])),
                "velocity_m_s": float(np.linalg.norm(np.array(estimator.velocity()) - truth["velocity"])),
                "from_setpoint_m": float(np.linalg.norm(here - flight.firmware.setpoint.position)) * holds,
            }
        )
    return rows


def main() -> None:
    """Fly and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--gyro-bias", type=float, default=0.0, help="rad/s, about each axis")
    parser.add_argument("--seed", type=int, default=0, help="of the first flight's noise")
    arguments = parser.parse_args()
    flights = [
        fly(steepest(speed), left, arguments.seed + 3 * i + j, arguments.gyro_bias)
        for i, speed in enumerate(SPEEDS)
        for j, left in enumerate(LOST_BEFORE_IMPACT_S)
    ]
    largest: list[dict[str, Any]] = [
        {"blind_s": blind, **{name: max(flight[k][name] for flight in flights) for name in flights[0][k]}}
        for k, blind in enumerate(BLIND_S)
    ]
    document = {
        "benchmark": "dead_reckoning",
        "gyro_bias_rad_s": arguments.gyro_bias,
        "flights": len(flights),
        "largest": largest,
    }
    print(json.dumps(document, indent=1))


if __name__ == "__main__":
    main()
