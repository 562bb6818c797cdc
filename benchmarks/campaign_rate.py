"""How many attempts a minute a campaign flies in a simulated lab, in lock step and in real time.

    python benchmarks/campaign_rate.py [--attempts 12] [--real]

Prints one JSON document: attempts a minute of the machine's clock from the first connection to the last
record, seconds of the processor for each attempt, and the outcomes. ``--real`` flies as many in real time in
the same run, for comparison. Starting the lab, and compiling, are not counted.
"""

import argparse
import json
import resource
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path
from typing import Any

from perchhw.attempt import DEFAULT_POLICY, DEFAULT_VEHICLE, AttemptRequest
from perchhw.flight.turnaround import attempt_after_attempt
from perchhw.lab_process import FREE_PORTS, SimulatedLab

CONDITIONS = tuple((speed, angle) for speed in (2.25, 2.5, 2.75) for angle in (50.0, 52.5, 55.0))


def campaign(pace: str, attempts: int, folder: Path, seed: int) -> dict[str, Any]:
    """Fly `attempts` in one lab at `pace`."""
    run = attempt_after_attempt(lambda _what: None)
    outcomes: Counter[str] = Counter()
    with SimulatedLab("lab", (*FREE_PORTS, "--pace", pace, "--seed", str(seed))) as lab:
        begin, own = time.monotonic(), time.process_time()
        for index in range(attempts):
            speed, angle = CONDITIONS[index % len(CONDITIONS)]
            request = AttemptRequest(
                speed=speed,
                angle_deg=angle,
                index=index,
                folder=folder / f"{pace}-{index:03d}",
                drone=lab.drones[0],
                mocap=lab.mocap[0],
                policy=DEFAULT_POLICY,
                vehicle=DEFAULT_VEHICLE,
            )
            outcomes[run(request).outcome.value] += 1
        elapsed, own = time.monotonic() - begin, time.process_time() - own
    return {
        "attempts": attempts,
        "attempts_a_minute": 60.0 * attempts / elapsed,
        "s_an_attempt": elapsed / attempts,
        "flight_cpu_s_an_attempt": own / attempts,
        "outcomes": dict(outcomes),
    }


def main() -> None:
    """Entry point."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--attempts", type=int, default=12)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--real", action="store_true", help="also fly in real time")
    arguments = parser.parse_args()
    document: dict[str, Any] = {"benchmark": "campaign_rate", "seed": arguments.seed}
    with tempfile.TemporaryDirectory() as folder:
        for pace in ("lockstep", "real") if arguments.real else ("lockstep",):
            document[pace] = campaign(pace, arguments.attempts, Path(folder), arguments.seed)
    children = resource.getrusage(resource.RUSAGE_CHILDREN)
    document["labs_cpu_s"] = children.ru_utime + children.ru_stime
    json.dump(document, sys.stdout, indent=1)
    sys.stdout.write("\n")


if __name__ == "__main__":
    main()
