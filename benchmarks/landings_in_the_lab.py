"""Landings of a policy in the simulated lab, over the real protocols. Prints one JSON document.

    python benchmarks/landings_in_the_lab.py [--policy P] [--attempts 200] [--seed 0] [--out DIR]

Speed (1.5 to 3.5 m/s) and angle (30 to 90 deg) are drawn until an approach at exactly that velocity stays
in the policy's trigger region for 20 ms, two looks of the drone, and fits the room. Each condition is
flown once, as `perchhw fly` does: upload, arm, take off, approach, flip, label. The lab
lives in lock step, so that the result hangs on the seed and not on the machine.
"""

import argparse
import json
import math
import sys
from collections import Counter
from pathlib import Path

import numpy as np

from onboard.errors import InputError
from onboard.policy.files import Policy, find_policy, load_policy, policy_crc32
from onboard.policy.trigger import trigger_values
from onboard.room import RoomGeometry
from perchhw.attempt import DEFAULT_VEHICLE, AttemptRequest
from perchhw.flight.mission import plan_attempt
from perchhw.flight.turnaround import attempt_after_attempt
from perchhw.lab_process import SimulatedLab

LOOKS = 2
"""Times that the drone looks at the cues while the approach is in the region."""


def time_in_region(policy: Policy, speed: float, angle: float) -> float:
    """Time (s) that an approach at constant velocity spends in the trigger region (speed m/s, angle rad)."""
    tau = np.arange(0.5, 0.05, -1e-3)
    d_ceil = tau * speed * math.sin(angle)
    states = np.stack([tau, speed * math.cos(angle) / d_ceil, d_ceil], axis=1).astype(np.float32)
    return 1e-3 * float(np.count_nonzero(trigger_values(policy.compiled(), states) >= 0.0))


def draw_condition(rng: np.random.Generator, policy: Policy, request: AttemptRequest) -> AttemptRequest:
    """A random condition that the policy covers and the room has place for."""
    while True:
        speed, angle_deg = round(rng.uniform(1.5, 3.5), 2), round(rng.uniform(30.0, 90.0), 1)
        if time_in_region(policy, speed, math.radians(angle_deg)) < LOOKS * 0.01:
            continue
        drawn = AttemptRequest(**{**vars(request), "speed": speed, "angle_deg": angle_deg})
        try:
            plan_attempt(drawn, policy_crc32(policy))
        except InputError:
            continue
        return drawn


def main() -> None:
    """Fly and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--policy", default="default", help="a shipped policy or a file")
    parser.add_argument("--vehicle", default=DEFAULT_VEHICLE, help="of the lab and of who flies in it")
    parser.add_argument("--attempts", type=int, default=200)
    parser.add_argument("--seed", type=int, default=0, help="of the conditions and of the lab's noise")
    parser.add_argument("--out", type=Path, default=Path("runs/landings-in-the-lab"))
    arguments = parser.parse_args()
    path = find_policy(arguments.policy)
    policy = load_policy(path)
    rng = np.random.default_rng(arguments.seed)
    fly = attempt_after_attempt(lambda what: None)
    rows = []
    ports = ["--drone-port", "0", "--vicon-port", "0", "--vicon-udp-port", "0"]
    world = ["--vehicle", arguments.vehicle, "--seed", str(arguments.seed), "--pace", "lockstep"]
    with SimulatedLab("lab", [*ports, *world]) as lab:
        for index in range(arguments.attempts):
            request = AttemptRequest(
                speed=0.0,
                angle_deg=0.0,
                index=index,
                folder=arguments.out / f"{index:03d}",
                drone=lab.drones[0],
                mocap=lab.mocap[0],
                policy=str(path),
                vehicle=arguments.vehicle,
                room=RoomGeometry(),
                seed=arguments.seed,
            )
            request = draw_condition(rng, policy, request)
            result = fly(request)
            row = {
                "speed_m_s": request.speed,
                "angle_deg": request.angle_deg,
                "triggered": result.triggered,
                "outcome": result.outcome.value,
                "aborted_by": result.aborted_by,
            }
            print(json.dumps(row), file=sys.stderr, flush=True)
            rows.append(row)
    outcomes = Counter(str(row["outcome"]) for row in rows)
    document = {
        "benchmark": "landings_in_the_lab",
        "policy_crc32": policy_crc32(policy),
        "vehicle": arguments.vehicle,
        "seed": arguments.seed,
        "four_leg_share": outcomes["four_leg"] / len(rows),
        "outcomes": dict(outcomes),
        "attempts": rows,
    }
    print(json.dumps(document, indent=1))


if __name__ == "__main__":
    main()
