"""The attitude law in the simulated drone, over motor lag and delay. Prints one JSON document.

    python benchmarks/attitude_margins.py [--delays-ms 0,4,8,12,16,20] [--lags-ms 50,75/141,100,150]
        [--seed 0]

Each case hovers for a second and then flies the paper's approach (2.5 m/s, 50 deg) with the shipped policy,
once with the law as it is (`lead`) and once with the gains that it had before it had a lead
(`without_lead`). A lag is one time constant, or UP/DOWN; the vehicle file that the drone was built for knows
it, but not the delay, which comes on top of the loop's own. The flights are those of the simulated lab
without its sockets and clock: sensor noise, estimator, 8-bit PWM and all. A case is lost when the body
turns at more than 1 rad/s (rms) in the hover, or when its approach does not end in a flip.

`margins` are calculated (`onboard.attitude_margins`) for no delay: a loop should be lost where the
delay is past them.
"""

import argparse
import dataclasses
import json
import sys
from pathlib import Path
from typing import Any

import numpy as np

from onboard import controller
from onboard.app_interface import LandingState, Parameter, TrajectoryStatus
from onboard.attitude_margins import attitude_margins
from onboard.controller import ControllerGains, controller_gains
from onboard.landing.state_machine import EndReason
from onboard.policy.bundle import encode_bundle
from onboard.policy.files import find_policy, load_policy
from onboard.quantity import Quantity
from onboard.room import RoomGeometry
from onboard.trajectory import fit_approach
from onboard.vehicle import Effect, Vehicle, load_vehicle

sys.path.insert(0, str(Path(__file__).parents[1]))

from tests.sim_crazyflie.simulated_flight import LEGS, VEHICLE, Flight

LOST_RATE = 1.0
"""rad/s rms of body rate in the hover."""

Lag = tuple[float, float]


def vehicle_with(lag: Lag, delay: float) -> Vehicle:
    """The paper's vehicle with other motors (s up, s down), told `delay` (s) too late."""
    vehicle = load_vehicle(VEHICLE, LEGS)
    up, down, late = (Quantity(value, "s", 0.0, "benchmark") for value in (*lag, delay))
    motors = dataclasses.replace(vehicle.motors, time_constant_up=up, time_constant_down=down)
    effect = Effect(name="command_delay", parameters={"delay": late})
    return dataclasses.replace(vehicle, motors=motors, effects=(effect,) if delay > 0.0 else ())


def without_lead(gains: ControllerGains) -> ControllerGains:
    """The gains as they were before the law had a lead, for the 38.1 g vehicle of the paper."""
    return gains._replace(
        kp_xy=0.4, kd_xy=0.32,
        kr_xy=0.012, kw_xy=0.0021, kr_z=0.003, kw_z=0.001, lead_zero=0.0, lead_pole=0.0,
    )  # fmt: skip


def rms(rows: list[Any]) -> float:
    """Root of the mean of the squared lengths of vectors."""
    return float(np.sqrt(np.mean(np.sum(np.square(rows), axis=1))))


def fly(lag: Lag, delay: float, bundle: bytes, seed: int) -> dict[str, Any]:
    """Hover and approach of one case, with the default gains as they are now."""
    vehicle = vehicle_with(lag, delay)
    flight = Flight(seed, vehicle=vehicle, flashed=dataclasses.replace(vehicle, effects=()))
    plan = fit_approach(2.5, 50.0, RoomGeometry())
    flight.upload(bundle)
    flight.set_plan(plan)
    flight.arm()
    flight.takeoff(plan.z0, 1.5)
    flight.run(2.0)
    flight.go_to(plan.x0, plan.y0, plan.z0, 2.0)
    flight.run(4.0)
    state = flight.drone.state
    turning = []
    for _ in range(1000):
        flight.tick()
        turning.append(state["omega"].copy())
    row = {"hover_rate_rms_rad_s": rms(turning), "lost": True}
    flight.write(Parameter.POLICY_ARM, 1)
    flight.write(Parameter.TRAJECTORY_ARM, 1)
    if rms(turning) > LOST_RATE or flight.param(Parameter.TRAJECTORY_STATUS) != TrajectoryStatus.ARMED:
        return row
    flight.write(Parameter.GO, 1)
    flight.run(0.01)
    turning, astray = [], []
    while flight.log("perch.state") == LandingState.APPROACH:
        turning.append(state["omega"].copy())
        astray.append(state["position"] - np.array(flight.firmware.setpoint.position))
        flight.tick()
    if not turning:
        return row
    flight.run(2.0)
    triggered = flight.log("perch.reason") == EndReason.TRIGGERED
    return {
        **row,
        "lost": not triggered,
        "ended": EndReason(int(flight.log("perch.reason"))).name.lower(),
        "approach_rate_rms_rad_s": rms(turning),
        "tracking_rms_m": rms(astray),
        "feet": int(state["foot_attached"].sum()),
        "body_contact": bool(state["body_contact"]),
    }


def lag_of(text: str) -> Lag:
    """Seconds up and down of ``UP/DOWN`` or one number, ms."""
    up, _, down = text.partition("/")
    return float(up) / 1e3, float(down or up) / 1e3


def main() -> None:
    """Fly and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--delays-ms", default="0,4,8,12,16,20")
    parser.add_argument("--lags-ms", default="50,75/141,100,150")
    parser.add_argument("--seed", type=int, default=0, help="of the sensors' noise")
    arguments = parser.parse_args()
    bundle = encode_bundle(load_policy(find_policy("default")))
    law = controller.DEFAULT_GAINS
    cases = []
    for lag in map(lag_of, arguments.lags_ms.split(",")):
        for name, gains in (("lead", law), ("without_lead", without_lead(law))):
            controller.DEFAULT_GAINS = gains
            margins = attitude_margins(controller_gains(load_vehicle(VEHICLE, LEGS)), *lag)
            for delay_ms in map(float, arguments.delays_ms.split(",")):
                cases.append(
                    {
                        "lag_up_s": lag[0],
                        "lag_down_s": lag[1],
                        "gains": name,
                        "margins": {"phase_deg": margins.phase_deg, "delay_s": margins.delay},
                        "delay_s": delay_ms / 1e3,
                        **fly(lag, delay_ms / 1e3, bundle, arguments.seed),
                    }
                )
    flown = {name: [case for case in cases if case["gains"] == name] for name in ("lead", "without_lead")}
    document = {
        "benchmark": "attitude_margins",
        "seed": arguments.seed,
        "lost": {name: sum(case["lost"] for case in rows) for name, rows in flown.items()},
        "flights": {name: len(rows) for name, rows in flown.items()},
        "cases": cases,
    }
    print(json.dumps(document, indent=1))


if __name__ == "__main__":
    main()
