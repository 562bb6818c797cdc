"""Time of the first start: from a finished install to the lab's ready line and to the first landing.

    python benchmarks/first_start.py

Prints one JSON document. Cold is with an empty cache of compiled kernels, warm is once more with what the
cold start left there. Wall seconds count from the start of the process; processor seconds are those of all
its processes until their end. `landing` is ``perchhw demo --attempts 1`` until it has labelled the attempt.
"""

import argparse
import json
import os
import re
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Mapping
from importlib.metadata import version
from pathlib import Path
from typing import Any

from machine import machine, processor_seconds

LAB = ("sim", "lab", "--drone-port", "0", "--vicon-port", "0", "--vicon-udp-port", "0")
DEMO = ("demo", "--json", "--attempts", "1", "--out")


def until(
    arguments: tuple[str, ...], stream: str, line: str, environment: Mapping[str, str]
) -> dict[str, float]:
    """Run ``perchhw ARGUMENTS`` until `stream` has a line that matches `line`, then to its end."""
    started, used = time.perf_counter(), processor_seconds()
    command = [sys.executable, "-m", "perchhw", *arguments]
    pipes: dict[str, Any] = {
        "stdout": subprocess.DEVNULL,
        "stderr": subprocess.DEVNULL,
        stream: subprocess.PIPE,
    }
    with subprocess.Popen(command, text=True, env=environment, **pipes) as process:
        lines = getattr(process, stream)
        said = next((said for said in lines if re.search(line, said)), None)
        wall = time.perf_counter() - started
        if said is None:
            sys.exit(f"`perchhw {' '.join(arguments)}` ended without a line like {line!r}")
        if arguments == LAB:
            process.send_signal(signal.SIGINT)
        for _ in lines:
            pass
    return {"wall_s": wall, "cpu_s": processor_seconds() - used}


def starts(arguments: tuple[str, ...], stream: str, line: str) -> dict[str, dict[str, float]]:
    """A cold start and a warm one."""
    with tempfile.TemporaryDirectory() as folder:
        environment = {name: value for name, value in os.environ.items() if name != "NUMBA_CACHE_DIR"}
        environment["XDG_CACHE_HOME"] = folder
        if arguments[-1] == "--out":
            arguments = (*arguments, str(Path(folder) / "runs"))
        return {start: until(arguments, stream, line, environment) for start in ("cold", "warm")}


def main() -> None:
    """Measure and print."""
    argparse.ArgumentParser(description=__doc__).parse_args()
    load = os.getloadavg()[0]
    document = {
        "benchmark": "first_start",
        "ready": starts(LAB, "stdout", '"ready"'),
        "landing": starts(DEMO, "stderr", "1 of 1 done"),
        "load_average_before": load,
        **machine(),
        "versions": {package: version(package) for package in ("numba", "llvmlite", "numpy")},
    }
    print(json.dumps(document, indent=1))


if __name__ == "__main__":
    main()
