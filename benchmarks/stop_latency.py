"""How long it takes from a fault until the motors are off, at real pace, through a real host and link.

``python benchmarks/stop_latency.py [--runs N] [--busy N] [--only FAULT]`` prints one JSON document: median
and worst of the N of each, in seconds, quiet or beside so many processes that only count. What stops it is
said beside it. The simulated drone is asked past the host, every 5 ms.

- ``second_key``: Ctrl-C twice in the hover; to the stop packet on the network, and to motors that are off.
- ``stop_command``: ``perchhw stop`` from another process in the hover; from its start, Python's included, to
  its first packet and to motors that are off. Whatever else stops is withheld.
- ``host_killed``: SIGKILL; only the drone's own watchdog is left.
- ``link_cut``: nothing passes any more, either way; likewise.
- ``loop_hung``: the supervisor's loop stands still while the rest of the host lives: its heart stops, the
  kicks stop with it.
- ``mocap_lost``: the process of the motion capture stands still (SIGSTOP) in the hover: no pose comes any
  more, and no connection closes. To the order to land at the drone, and how much of that is beyond the 0.3 s
  that the rule ``pose_age`` allows.
"""

import argparse
import json
import os
import signal
import statistics
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from onboard.link.uri import parse_udp_uri
from perchhw.lab_process import SimulatedLab
from perchhw.supervisor import SafetyLimits
from tests.flight.airborne import Airborne, NotInTheAir, is_stop
from tests.lab_time.busy import busy_processes
from tests.link.faulty_network import Faults, FaultyNetwork

MOTORS_WITHIN = 5.0
COMMAND_WITHIN = 30.0
"""A machine that is busy takes seconds to start Python."""
HANG_S = 4.0
TRIES = 5
POSE_AGE = SafetyLimits().pose_age_bridged
PORTS = ("--drone-port", "0", "--vicon-port", "0", "--vicon-udp-port", "0", "--seed", "5")


def second_key(air: Airborne, rng: np.random.Generator, _lab: SimulatedLab) -> dict[str, float | None]:
    """Two keys, 5 to 150 ms apart."""
    air.take_off("moving to start")
    air.key()
    threading.Event().wait(float(rng.uniform(0.005, 0.15)))
    begin = air.key()
    off = air.witness.motors_off(MOTORS_WITHIN)
    air.ended()
    return {"to_network": air.attempted[0] - begin, "to_motors_off": since(begin, off)}


def stop_command(air: Airborne, rng: np.random.Generator, lab: SimulatedLab) -> dict[str, float | None]:
    """Somebody else's process, over a network of its own that loses nothing."""
    air.take_off("moving to start")
    with FaultyNetwork(parse_udp_uri(lab.drones[0]).port, rng, Faults()) as network:
        packets: list[float] = []

        def note(packet: bytes) -> bool:
            if is_stop(packet):
                packets.append(time.monotonic())
            return False

        network.withheld = note
        command = [sys.executable, "-m", "perchhw", "stop", "--drone", network.uri, "--json"]
        begin = time.monotonic()
        with subprocess.Popen(command, stdout=subprocess.DEVNULL):
            off = air.witness.motors_off(COMMAND_WITHIN)
    air.ended()
    return {"to_network": since(begin, packets[0] if packets else None), "to_motors_off": since(begin, off)}


def host_killed(air: Airborne, rng: np.random.Generator, _lab: SimulatedLab) -> dict[str, float | None]:
    """SIGKILL in the hover."""
    air.take_off("moving to start")
    threading.Event().wait(float(rng.uniform(0.3, 0.5)))
    begin = time.monotonic()
    air.host.kill()
    return {"to_motors_off": since(begin, air.witness.motors_off(MOTORS_WITHIN))}


def link_cut(air: Airborne, rng: np.random.Generator, _lab: SimulatedLab) -> dict[str, float | None]:
    """Every packet is lost from here on."""
    air.take_off("moving to start")
    threading.Event().wait(float(rng.uniform(0.3, 0.5)))
    begin = time.monotonic()
    air.network.faults = Faults(loss=1.0)
    off = air.witness.motors_off(MOTORS_WITHIN)
    air.ended()
    return {"to_motors_off": since(begin, off)}


def loop_hung(air: Airborne, _rng: np.random.Generator, _lab: SimulatedLab) -> dict[str, float | None]:
    """The loop stands still when it comes to the hover."""
    air.take_off("moving to start", hang_s=HANG_S)
    begin = time.monotonic()
    off = air.witness.motors_off(MOTORS_WITHIN)
    air.ended()
    return {"to_motors_off": since(begin, off)}


def mocap_lost(air: Airborne, rng: np.random.Generator, lab: SimulatedLab) -> dict[str, float | None]:
    """No pose from here on; the drone lands without."""
    air.take_off("moving to start")
    threading.Event().wait(float(rng.uniform(0.3, 0.5)))
    if air.landings:
        raise NotInTheAir("it was landing before its poses were lost")
    room = lab.ready["processes"]["room"]
    begin = time.monotonic()
    os.kill(room, signal.SIGSTOP)
    try:
        ended = air.ended()
    finally:
        os.kill(room, signal.SIGCONT)
    if "pose" not in str(ended.get("aborted_by")):
        raise NotInTheAir(f"it was ended otherwise: {ended}")
    landed = air.landings[0] if air.landings else None
    return {"to_order": since(begin, landed), "beyond_the_rule": since(begin + POSE_AGE, landed)}


Figures = dict[str, float | None]
FAULTS: dict[str, tuple[Callable[[Airborne, np.random.Generator, SimulatedLab], Figures], str]] = {
    "second_key": (second_key, "the stop packet; watchdog and closing setpoint are withheld"),
    "stop_command": (stop_command, "the stop packet of perchhw stop; whatever else stops is withheld"),
    "host_killed": (host_killed, "the drone's watchdog, 1 s after the last kick"),
    "link_cut": (link_cut, "the drone's watchdog, 1 s after the last kick that arrived"),
    "loop_hung": (loop_hung, "the drone's watchdog, 1 s after the last kick, 0.3 s after the last heartbeat"),
    "mocap_lost": (mocap_lost, f"the order to land, when the last good pose is {POSE_AGE:g} s old"),
}


def since(begin: float, end: float | None) -> float | None:
    """Seconds, or None for what did not come."""
    return None if end is None else end - begin


def measure(name: str, runs: int, lab: SimulatedLab, folder: Path) -> list[dict[str, float | None]]:
    """So many runs of one fault, each on a host of its own where it is killed."""
    found: list[dict[str, float | None]] = []
    fault, _ = FAULTS[name]
    for run in range(runs):
        rng = np.random.default_rng((run, len(name)))
        for attempt in range(TRIES):
            place = folder / f"{name}-{run}-{attempt}"
            host = ("--pose-age", str(POSE_AGE)) if name == "mocap_lost" else ()
            with Airborne(lab.drones[0], lab.mocap[0], place, rng, host) as air:
                air.withhold(name == "stop_command", watchdog=name not in ("second_key", "stop_command"))
                try:
                    found.append(fault(air, rng, lab))
                except NotInTheAir as error:
                    sys.stderr.write(f"{name}: {error}\n")
                    continue
            break
    return found


def summary(found: list[dict[str, float | None]]) -> dict[str, object]:
    """Median and worst of each figure; None where the motors did not stop."""
    figures: dict[str, object] = {"runs": len(found)}
    for figure in found[0] if found else ():
        values = [row[figure] for row in found]
        known = [value for value in values if value is not None]
        figures[figure] = {
            "median": round(statistics.median(known), 4) if known else None,
            "worst": round(max(known), 4) if len(known) == len(values) else None,
        }
    return figures


def main() -> int:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--runs", type=int, default=5)
    parser.add_argument("--busy", type=int, default=0, help="processes beside it that only count")
    parser.add_argument("--only", choices=tuple(FAULTS), action="append", help="may be repeated")
    arguments = parser.parse_args()
    with (
        SimulatedLab("lab", PORTS) as lab,
        tempfile.TemporaryDirectory() as folder,
        busy_processes(arguments.busy),
    ):
        document: dict[str, object] = {"busy": arguments.busy, "load_before": os.getloadavg()[0]}
        for name in arguments.only or FAULTS:
            found = measure(name, arguments.runs, lab, Path(folder))
            document[name] = {**summary(found), "stopped_by": FAULTS[name][1]}
    print(json.dumps(document, indent=1))
    return 0


if __name__ == "__main__":
    sys.exit(main())
