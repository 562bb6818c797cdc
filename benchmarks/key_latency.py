"""From `space` on the screen of a flight to motors that may not turn, by the drone's own word, at real pace.

``python benchmarks/key_latency.py [--presses 8] [--busy 8]`` prints one JSON document: median and worst (ms),
quiet, then beside so many processes that only count. The drone is asked past the host every 5 ms. A flight
that ends before the key is flown again.
"""

import argparse
import itertools
import json
import os
import statistics
import sys
import tempfile
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from perchhw.lab_process import FREE_PORTS, SimulatedLab
from tests.flight.airborne import Witness, when_it_flies
from tests.lab_time.busy import busy_processes
from tests.screen.pressed import from_space_to_motors_off

LIMIT_MS = 200.0


def measure(presses: int, busy: int) -> dict[str, Any]:
    """So many presses beside so many busy processes."""
    with (
        SimulatedLab("lab", (*FREE_PORTS, "--seed", "3")) as lab,
        tempfile.TemporaryDirectory() as folder,
        busy_processes(busy),
    ):
        witness, places = Witness(lab.drones[0]), map(Path(folder).joinpath, map(str, itertools.count()))
        load = os.getloadavg()[0]
        times = [
            1e3 * when_it_flies(lambda: from_space_to_motors_off(lab, witness, next(places)))
            for _ in range(presses)
        ]
        witness.close()
    return {
        "busy": busy,
        "load_before": load,
        "presses": presses,
        "median_ms": round(statistics.median(times), 1),
        "worst_ms": round(max(times), 1),
        "all_below_200_ms": max(times) < LIMIT_MS,
    }


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--presses", type=int, default=8, help="of each")
    parser.add_argument("--busy", type=int, default=8, help="processes beside the second half")
    asked = parser.parse_args()
    quiet, busy = measure(asked.presses, 0), measure(asked.presses, asked.busy)
    print(json.dumps({"benchmark": "key_latency", "quiet": quiet, "beside_busy": busy}, indent=1))


if __name__ == "__main__":
    main()
