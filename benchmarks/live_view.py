"""What a live view costs a flight: how long a pose is on its way through the host, with and without one.

    python benchmarks/live_view.py [--pairs 2]

Flies approaches in one simulated lab in real time, in turn without and with `perchhw view --web` on the
growing record. Prints one JSON document: for each flight the median and the 99th percentile of the time from
the socket of the motion capture to the link's return (ms, the last 1000 poses), the medians over the flights,
and their difference. The viewer serves its page; a browser on the same machine would take what it takes.
"""

import argparse
import json
import os
import platform
import statistics
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

from mocap_bridge.bridge import PoseBridge
from perchhw.attempt import DEFAULT_POLICY, DEFAULT_VEHICLE, AttemptRequest
from perchhw.flight.turnaround import attempt_after_attempt
from perchhw.lab_process import FREE_PORTS, SimulatedLab


class WatchedBridge:
    """Keeps what every bridge of this process says of its delays when it stops."""

    def __init__(self) -> None:
        self.residences: list[tuple[float, float]] = []
        stop = PoseBridge.stop

        def watched(bridge: PoseBridge) -> bool:
            status = bridge.status()
            if status.residence_p50 is not None and status.residence_p99 is not None:
                self.residences.append((status.residence_p50, status.residence_p99))
            return stop(bridge)

        PoseBridge.stop = watched  # type: ignore[method-assign]


def view_of(folder: Path) -> "subprocess.Popen[bytes]":
    """A view that ends when the record in `folder` has ended."""
    command = [sys.executable, "-m", "perchhw", "view", str(folder), "--web"]
    return subprocess.Popen(
        [*command, "--wait", "60", "--linger", "0"], stdout=subprocess.DEVNULL, start_new_session=True
    )


def measure(pairs: int, folder: Path) -> list[dict[str, Any]]:
    """Fly `pairs` times without and with a view."""
    watched, flights = WatchedBridge(), []
    run = attempt_after_attempt(lambda _what: None)
    with SimulatedLab("lab", (*FREE_PORTS, "--seed", "5")) as lab:
        for index in range(2 * pairs):
            viewed = index % 2 == 1
            place = folder / f"20260101T0000{index:02d}Z-flight"
            place.mkdir()
            viewer = view_of(place) if viewed else None
            request = AttemptRequest(
                speed=2.5,
                angle_deg=50.0,
                index=index,
                folder=place,
                drone=lab.drones[0],
                mocap=lab.mocap[0],
                policy=DEFAULT_POLICY,
                vehicle=DEFAULT_VEHICLE,
                seed=index,
            )
            result = run(request)
            if viewer is not None:
                viewer.wait(timeout=300)  # it yields to everybody
            p50, p99 = watched.residences[-1]
            row = {"view": viewed, "outcome": result.outcome, "p50_ms": 1e3 * p50, "p99_ms": 1e3 * p99}
            flights.append(row | {"load": os.getloadavg()[0]})
    return flights


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--pairs", type=int, default=2, help="flights without and with a view")
    pairs = parser.parse_args().pairs
    with tempfile.TemporaryDirectory() as folder:
        flights = measure(pairs, Path(folder))
    p99 = {
        viewed: statistics.median(row["p99_ms"] for row in flights if row["view"] is viewed)
        for viewed in (False, True)
    }
    document = {
        "benchmark": "live_view",
        "machine": {"cpus": os.cpu_count(), "python": platform.python_version()},
        "flights": flights,
        "p99_ms_without": p99[False],
        "p99_ms_with": p99[True],
        "difference_ms": p99[True] - p99[False],
        "ratio": p99[True] / p99[False],
    }
    print(json.dumps(document, indent=1))


if __name__ == "__main__":
    main()
