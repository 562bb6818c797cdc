"""How a peer takes its turn: one repeat of every case for each line on standard input.

A peer runs in a Python of its own, with its own packages and without perchhw. It prints `{"ready": ...}` when
everything is compiled, then one JSON line a turn, and ends with its input.
"""

import json
import sys
import time
from collections.abc import Callable
from importlib.metadata import version

Case = Callable[[], int]
"""Does a repeat and returns how many steps that were."""


def take_turns(cases: dict[str, Case], packages: tuple[str, ...]) -> None:
    """Warm every case up, then time one repeat of each whenever asked."""
    for case in cases.values():
        case()
    ready = {"cases": list(cases), "versions": {package: version(package) for package in packages}}
    print(json.dumps({"ready": ready}), flush=True)
    for _ in sys.stdin:
        turn = {}
        for name, case in cases.items():
            wall, processor = time.perf_counter(), time.process_time()
            steps = case()
            turn[name] = {
                "steps": steps,
                "wall_s": time.perf_counter() - wall,
                "cpu_s": time.process_time() - processor,
            }
        print(json.dumps(turn), flush=True)
