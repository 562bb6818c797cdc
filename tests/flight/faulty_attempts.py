"""Attempts in which something goes wrong: every one of them ends, says how, and leaves the drone at rest.

``python -m tests.flight.faulty_attempts --attempts 200`` flies so many, each in a lab of its own in lock step
with one or two faults drawn at random. The judge is the world's own record of what happened, not what the
flight believes: a drone that has power and a firmware that runs must be at rest in the end, and a label must
not promise feet that do not hold. One JSON document at the end; exit code 1 when one was broken.
"""

import argparse
import json
import sys
import tempfile
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np

from onboard.errors import PerchhwError
from perchhw.attempt import DEFAULT_POLICY, DEFAULT_VEHICLE, AttemptRequest
from perchhw.flight import fly_attempt
from perchhw.lab_process import FREE_PORTS, LOCKSTEP, SimulatedLab
from perchhw.record import read_run

AT_REST_M_S = 0.3
HOLDING = {"four_leg": 3, "four_leg_body_contact": 3, "two_leg": 1, "two_leg_body_contact": 1}
"""Feet that must hold for a label."""
POWERLESS = ("freeze_drone_at", "drone_dies_at")
"""Faults after which nobody can promise where the drone ends."""


def draw_faults(rng: np.random.Generator) -> dict[str, str]:
    """One or two faults and when they strike, s of the lab: from before arming until after the landing."""
    begin, duration = rng.uniform(0.0, 15.0), rng.choice([0.02, 0.1, 0.3, 1.0, 5.0])
    kinds = {
        "mocap_drop": f"{rng.uniform(0.05, 0.6):.3f}",
        "mocap_jitter_ms": f"{rng.uniform(1.0, 60.0):.1f}",
        "mocap_occlude_at": f"{begin:.3f}:{duration}",
        "mocap_freeze_at": f"{begin:.3f}:{duration}",
        "mocap_flip180_at": f"{begin:.3f}:{duration}",
        "mocap_dies_at": f"{begin:.3f}",
        "link_loss": f"{rng.uniform(0.01, 0.3):.3f}",
        "freeze_drone_at": f"{begin:.3f}",
        "drone_dies_at": f"{begin:.3f}",
        "gyro_bias": ",".join(f"{bias:.3f}" for bias in rng.uniform(-0.2, 0.2, 3)),
        "battery_voltage": f"{rng.uniform(3.6, 4.2):.2f}",
    }
    names = rng.choice(sorted(kinds), size=rng.integers(1, 3), replace=False)
    return {str(name): kinds[str(name)] for name in names}


def fly(folder: Path, seed: int, faults: dict[str, str]) -> dict[str, Any]:
    """One attempt, and what is wrong with how it ended (None: nothing)."""
    truth = folder / "truth.csv"
    shown = [part for name, value in faults.items() for part in ("--fault", f"{name}={value}")]
    rng = np.random.default_rng(seed)
    with SimulatedLab(
        "lab", (*FREE_PORTS, *LOCKSTEP, "--seed", str(seed), "--truth", str(truth), *shown)
    ) as lab:
        request = AttemptRequest(
            speed=float(rng.uniform(2.0, 3.0)),
            angle_deg=float(rng.uniform(45.0, 70.0)),
            index=0,
            folder=folder / "run",
            drone=lab.drones[0],
            mocap=lab.mocap[0],
            policy=DEFAULT_POLICY,
            vehicle=DEFAULT_VEHICLE,
        )
        try:
            result = fly_attempt(request)
        except PerchhwError as error:
            return {"faults": faults, "outcome": "refused", "why": str(error), "wrong": None}
    return {
        "faults": faults,
        "outcome": result.outcome.value,
        "why": result.aborted_by,
        "wrong": what_is_wrong(truth, result.outcome.value, folder / "run", faults),
    }


def what_is_wrong(truth: Path, outcome: str, run: Path, faults: dict[str, str]) -> str | None:
    """By the world's record; None when nothing is."""
    internal = [event for event in read_run(run).events if event["event"] == "internal_error"]
    if internal:
        return f"an error of ours: {internal[0]['error']}"
    header, *rows = truth.read_text().splitlines()
    last = dict(zip(header.split(","), rows[-1].split(","), strict=True)) if rows else {}
    feet = int(last.get("legs_attached", "0"))
    if feet < HOLDING.get(outcome, 0):
        return f"labelled {outcome}, and {feet} feet hold"
    speed = max(abs(float(last.get(axis, "0"))) for axis in ("vx", "vy", "vz"))
    if speed > AT_REST_M_S and not faults.keys() & set(POWERLESS):
        return f"it is not at rest: {speed:.2f} m/s at {last['z']} m"
    return None


def main() -> int:
    """Entry point."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--attempts", type=int, default=200)
    parser.add_argument("--seed", type=int, default=0)
    arguments = parser.parse_args()
    flown = []
    for index in range(arguments.attempts):
        seed = arguments.seed + index
        with tempfile.TemporaryDirectory() as folder:
            flown.append(fly(Path(folder), seed, draw_faults(np.random.default_rng((seed, 1)))))
        sys.stderr.write(f"{index + 1} of {arguments.attempts}: {flown[-1]}\n")
    broken = [attempt for attempt in flown if attempt["wrong"] is not None]
    document = {
        "attempts": len(flown),
        "seed": arguments.seed,
        "outcomes": Counter(attempt["outcome"] for attempt in flown),
        "broken": broken,
    }
    json.dump(document, sys.stdout, indent=1)
    sys.stdout.write("\n")
    return 1 if broken else 0


if __name__ == "__main__":
    sys.exit(main())
