"""The same seed gives the same flight: whole attempts in fresh labs, quiet and beside busy processes.

``python -m tests.lab_time.same_flight --busy 16`` flies the same campaign in two labs, one of them beside so
many processes that do nothing but count, and compares the times of arming, the samples of the triggers and
the labels. One JSON document at the end; exit code 1 unless they are the same.
"""

import argparse
import json
import sys
import tempfile
from pathlib import Path
from typing import Any

from perchhw.attempt import DEFAULT_POLICY, DEFAULT_VEHICLE, AttemptRequest
from perchhw.flight.turnaround import attempt_after_attempt
from perchhw.lab_process import FREE_PORTS, LOCKSTEP, SimulatedLab
from perchhw.record import read_run
from tests.lab_time.busy import busy_processes

CONDITIONS = ((2.5, 50.0), (2.25, 55.0), (2.75, 52.5))


def flights(folder: Path, seed: int, busy: int, count: int) -> list[dict[str, Any]]:
    """What decides `count` attempts in a lab of its own."""
    run = attempt_after_attempt(lambda _what: None)
    told = []
    with SimulatedLab("lab", (*FREE_PORTS, *LOCKSTEP, "--seed", str(seed))) as lab, busy_processes(busy):
        for index in range(count):
            speed, angle = CONDITIONS[index % len(CONDITIONS)]
            request = AttemptRequest(
                speed=speed,
                angle_deg=angle,
                index=index,
                folder=folder / f"{busy}-{index}",
                drone=lab.drones[0],
                mocap=lab.mocap[0],
                policy=DEFAULT_POLICY,
                vehicle=DEFAULT_VEHICLE,
            )
            result = run(request)
            events = read_run(result.record).events
            told.append(
                {
                    "armed_at": next((e["t"] for e in events if e.get("phase") == "arming"), None),
                    "trigger": result.trigger,
                    "outcome": result.outcome.value,
                    "aborted_by": result.aborted_by,
                }
            )
    return told


def same(seed: int, busy: int, count: int) -> dict[str, Any]:
    """Both series, and whether they are the same."""
    with tempfile.TemporaryDirectory() as folder:
        quiet, loaded = (flights(Path(folder), seed, n, count) for n in (0, busy))
    return {"busy": busy, "seed": seed, "same": quiet == loaded, "quiet": quiet, "loaded": loaded}


def main() -> int:
    """Entry point."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--busy", type=int, default=16)
    parser.add_argument("--flights", type=int, default=3)
    parser.add_argument("--seed", type=int, default=1)
    arguments = parser.parse_args()
    document = same(arguments.seed, arguments.busy, arguments.flights)
    json.dump(document, sys.stdout, indent=1)
    sys.stdout.write("\n")
    return 0 if document["same"] else 1


if __name__ == "__main__":
    sys.exit(main())
