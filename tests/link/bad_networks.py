"""How long connecting to the simulated drone takes over bad networks, its tables unknown and known.

``python -m tests.link.bad_networks`` prints one JSON document: s and datagrams that went through, for each.
"""

import json
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

from onboard.link import DroneLink
from perchhw.lab_process import SimulatedLab
from tests.link.faulty_network import Faults, FaultyNetwork
from tests.patience import patient_uri

NETWORKS = {
    "good": Faults(),
    "4 ms each way": Faults(delay=0.004),
    "30 ms each way": Faults(delay=0.03),
    "a fifth lost each way": Faults(loss=0.2),
    "0 to 50 ms each way": Faults(jitter=0.05),
}


def connect(network: FaultyNetwork, tables: Path) -> dict[str, float]:
    """One connection, closed again."""
    before, start = network.forwarded, time.monotonic()
    link = DroneLink.open(patient_uri(network.uri), toc_cache=tables)
    seconds, datagrams = time.monotonic() - start, network.forwarded - before
    link.close()
    return {"seconds": round(seconds, 2), "datagrams": datagrams}


def main() -> None:
    """Measure and print."""
    measured = {}
    with SimulatedLab("drone", ("--drone-port", "0")) as simulated:
        port = int(simulated.drones[0].rpartition(":")[2])
        for name, faults in NETWORKS.items():
            with (
                tempfile.TemporaryDirectory() as folder,
                FaultyNetwork(port, np.random.default_rng(7), faults) as network,
            ):
                tables = Path(folder, "tables")
                measured[name] = {what: connect(network, tables) for what in ("cold", "cached")}
    json.dump({"connecting": measured}, sys.stdout, indent=1)
    sys.stdout.write("\n")


if __name__ == "__main__":
    main()
