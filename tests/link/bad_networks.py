"""How long connecting to the simulated drone takes over bad networks, its tables unknown and known.

``python -m tests.link.bad_networks`` prints one JSON document: s and datagrams that went through, for each,
and how long cflib needs over its own driver with its tables unknown; null where three minutes do not suffice.
"""

import json
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np

from onboard.link import DroneLink
from perchhw.lab_process import SimulatedLab
from tests.conftest import REPOSITORY
from tests.link.faulty_network import Faults, FaultyNetwork

NETWORKS = {
    "good": Faults(),
    "4 ms each way": Faults(delay=0.004),
    "30 ms each way": Faults(delay=0.03),
    "a fifth lost each way": Faults(loss=0.2),
    "0 to 50 ms each way": Faults(jitter=0.05),
}


BARE_DEADLINE_S = 180.0


def connect(network: FaultyNetwork, tables: Path) -> dict[str, float]:
    """One connection, closed again."""
    before, start = network.forwarded, time.monotonic()
    link = DroneLink.open(network.uri, toc_cache=tables)
    seconds, datagrams = time.monotonic() - start, network.forwarded - before
    link.close()
    return {"seconds": round(seconds, 2), "datagrams": datagrams}


def connect_bare(network: FaultyNetwork) -> float | None:
    """Seconds that cflib needs by itself."""
    command = [sys.executable, "-m", "tests.link.bare_cflib", network.uri]
    try:
        run = subprocess.run(
            command, cwd=REPOSITORY, capture_output=True, text=True, check=True, timeout=BARE_DEADLINE_S
        )
    except subprocess.TimeoutExpired:
        return None
    return float(run.stdout)


def main() -> None:
    """Measure and print."""
    measured: dict[str, dict[str, Any]] = {}
    with SimulatedLab("drone", ("--drone-port", "0")) as simulated:
        port = int(simulated.drones[0].rpartition(":")[2])
        for name, faults in NETWORKS.items():
            with (
                tempfile.TemporaryDirectory() as folder,
                FaultyNetwork(port, np.random.default_rng(7), faults) as network,
            ):
                tables = Path(folder, "tables")
                measured[name] = {what: connect(network, tables) for what in ("cold", "cached")}
                measured[name]["cflib_s"] = connect_bare(network)
    json.dump({"connecting": measured}, sys.stdout, indent=1)
    sys.stdout.write("\n")


if __name__ == "__main__":
    main()
