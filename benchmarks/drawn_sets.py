"""Sets that are drawn at random: seeds that nobody can have tuned to, tables that are kept, shares."""

import json
import math
import subprocess
import sys
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any


def seed_of_commit() -> int:
    """A number that the finder's last commit gives."""
    done = subprocess.run(
        ["git", "log", "-1", "--format=%H", "--", "calibration/gap"],
        capture_output=True, text=True, check=True, cwd=Path(__file__).parent.parent,
    )  # fmt: skip
    return int(done.stdout[:8], 16)


def runs_of(
    table: Path,
    keys: Iterable[Any],
    key_of: Callable[[dict[str, Any]], Any],
    run: Callable[[Any], dict[str, Any]],
) -> list[dict[str, Any]]:
    """All runs of a table (one JSON document a line), those of `keys` that it lacks appended."""
    runs = [json.loads(line) for line in table.read_text().splitlines()] if table.exists() else []
    known = {key_of(one) for one in runs}
    for key in keys:
        if key not in known:
            runs.append(run(key))
            with table.open("a") as out:
                out.write(json.dumps(runs[-1]) + "\n")
            print(json.dumps(runs[-1]), file=sys.stderr, flush=True)
    return runs


def share(values: list[bool]) -> str:
    """How many, and the share with Wilson's interval of 95 %."""
    if not values:
        return "none"
    low, high = wilson(values)
    return f"{sum(values)} of {len(values)} ({low:.2f} to {high:.2f})"


def wilson(values: list[bool]) -> tuple[float, float]:
    """Wilson's interval of 95 % of a share (E. B. Wilson, JASA 22, 1927); `values` are not empty."""
    count, z = len(values), 1.96
    p = sum(values) / count
    middle = (p + z * z / (2 * count)) / (1 + z * z / count)
    half = z / (1 + z * z / count) * math.sqrt(p * (1 - p) / count + z * z / (4 * count * count))
    return max(middle - half, 0.0), min(middle + half, 1.0)
