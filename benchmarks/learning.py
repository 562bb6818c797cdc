"""How long learning takes: sweep, training and validation of one design, six designs, and second starts.

    python benchmarks/learning.py [--speeds S] [--angles A] [--workers N] [--no-legs] [--out DIR]

Every figure is that of a command in a process of its own, as a user runs it: seconds of wall time (start
of Python included), of processor time, and the peak of its memory. The grid is the default of `perchhw
learn` (1,071 trials) unless a smaller one is given. A small run goes first, so that nothing is compiled
in the figures; `first_start` is that run. A second start is the median of five runs. Prints one JSON
document.
"""

import argparse
import json
import os
import resource
import statistics
import subprocess
import sys
import tempfile
import time
from importlib.metadata import version
from pathlib import Path
from typing import Any

from machine import machine

REPEATS = 5
MEGABYTE = 2**20 if sys.platform == "darwin" else 2**10
"""Units of ru_maxrss in a megabyte."""

SMALL_GRID = ["--speeds", "2.5", "--angles", "45", "--repeats", "1"]
STATES = "tau,theta_x,d_ceil\n0.23,4.0,0.35\n0.30,3.0,0.50\n"


def run(*arguments: str) -> tuple[dict[str, float], Any]:
    """One `perchhw` command: what it cost, and its JSON document (None for --help)."""
    asks_for_help = "--help" in arguments
    command = [sys.executable, "-m", "perchhw", *([] if asks_for_help else ["--json"]), *arguments]
    started = time.perf_counter()
    with tempfile.TemporaryFile() as output:
        process = subprocess.Popen(command, stdout=output, stderr=subprocess.DEVNULL)
        _, status, usage = os.wait4(process.pid, 0)
        process.returncode = os.waitstatus_to_exitcode(status)
        seconds = time.perf_counter() - started
        output.seek(0)
        text = output.read().decode()
    if process.returncode != 0:
        sys.exit(f"perchhw {' '.join(arguments)} ended with {process.returncode}")
    return cost(seconds, usage), None if asks_for_help else json.loads(text)


def cost(seconds: float, usage: resource.struct_rusage) -> dict[str, float]:
    """Seconds of wall and processor time, and peak memory."""
    return {
        "seconds": seconds,
        "cpu_s": usage.ru_utime + usage.ru_stime,
        "peak_memory_mb": usage.ru_maxrss / MEGABYTE,
    }


def second_start(*arguments: str) -> dict[str, float]:
    """Median of a command run again and again; `{}` in an argument becomes the number of the run."""
    costs = [run(*(argument.format(k) for argument in arguments))[0] for k in range(REPEATS)]
    return {name: statistics.median(each[name] for each in costs) for name in costs[0]}


def one_design(folder: Path, grid: list[str], workers: list[str]) -> dict[str, Any]:
    """Sweep, training and validation."""
    out = ["--out", str(folder)]
    swept, document = run("learn", "sweep", *grid, *workers, *out)
    attempts = int(document["rollouts"])
    trained, _ = run("learn", "train", "--refine", *out)
    validated, _ = run("learn", "validate", *grid, *workers, *out)
    return {
        "sweep": {**swept, "attempts": attempts, "attempts_per_s": attempts / swept["seconds"]},
        "train": trained,
        "validate": validated,
        "seconds": swept["seconds"] + trained["seconds"] + validated["seconds"],
    }


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--speeds", help="of the grid, as in perchhw learn")
    parser.add_argument("--angles", help="of the grid, as in perchhw learn")
    parser.add_argument("--workers", type=int, help="threads; one a core without it")
    parser.add_argument("--no-legs", action="store_true", help="leave the six designs out")
    parser.add_argument("--out", type=Path, help="keep the folders here")
    arguments = parser.parse_args()
    grid = [*(["--speeds", arguments.speeds] if arguments.speeds else [])]
    grid += ["--angles", arguments.angles] if arguments.angles else []
    workers = ["--workers", str(arguments.workers)] if arguments.workers else []
    with tempfile.TemporaryDirectory() as temporary:
        folder = arguments.out or Path(temporary)
        folder.mkdir(parents=True, exist_ok=True)
        states = folder / "states.csv"
        states.write_text(STATES, encoding="utf-8")
        first, _ = run("learn", "sweep", *SMALL_GRID, "--out", str(folder / "first"))
        run("learn", "validate", *SMALL_GRID[:4], "--policy", "default", "--out", str(folder / "first"))
        document = {
            "benchmark": "learning",
            "first_start": first,
            "one_design": one_design(folder / "one", grid, workers),
            "six_designs": None
            if arguments.no_legs
            else run("learn", "legs", *grid, *workers, "--out", str(folder / "legs"))[0],
            "second_start": {
                "perchhw --help": second_start("--help"),
                "perchhw policy eval": second_start("policy", "eval", "default", "--states", str(states)),
                "perchhw learn sweep, one trial": second_start(
                    "learn", "sweep", *SMALL_GRID, "--out", str(folder / "again{}")
                ),
            },
            "grid": grid or "default",
            "load_average": os.getloadavg()[0],
            **machine(),
            "versions": {package: version(package) for package in ("perchhw", "numba", "numpy")},
        }
    print(json.dumps(document, indent=1))


if __name__ == "__main__":
    main()
