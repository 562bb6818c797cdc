"""Which tests a run takes, and in what order: for ``make test``, ``make soak`` and ``make soak-sample``."""

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
import pytest

LONGEST = (
    "docs/test_flight_day.py",
    "gap/test_find.py",
    "report/test_learning_report.py",
    "flight/test_attempt.py",
    "bench_commands/test_wizards.py",
    "gap/test_landing_gap.py",
    "cli/test_demo.py",
    "onboard/test_kernel_cache.py",
    "rehearsal/test_rehearse.py",
    "test_pytest_lab.py",
    "examples/test_examples.py",
    "lab_time/test_lockstep_lab.py",
    "flight/test_loop.py",
    "sim_crazyflie/test_landing_app.py",
    "gap/test_drawn_sets.py",
    "bench_commands/test_remote_cut.py",
    "learning/test_cluster.py",
)  # fmt: skip
"""Files of tests, below this folder, that take longest: begun first, lest one worker be left with them."""

Item = TypeVar("Item")


def some(cases: Iterable[Item], every: int) -> list[Any]:
    """Parameters of a test with many cases alike: each `every`-th is in ``make test``, the others are further
    ones."""
    return [
        case if number % every == 0 else pytest.param(*_values(case), marks=pytest.mark.further)
        for number, case in enumerate(cases)
    ]


def _values(case: Any) -> tuple[Any, ...]:
    return case if isinstance(case, tuple) else (case,)


def longest_first(items: Sequence[Item], files: Sequence[Path]) -> list[Item]:
    """`items`, those of the longest files first, else in their order; `files` has the file of each."""
    here = Path(__file__).parent
    place = {here / name: number for number, name in enumerate(LONGEST)}
    order = sorted(range(len(items)), key=lambda k: place.get(files[k], len(place)))
    return [items[k] for k in order]


def drawn(items: Sequence[Item], count: int, seed: int) -> tuple[list[Item], list[Item]]:
    """`count` of `items` (or all, where there are no more), each as likely, and the others; both in their
    order. The same seed draws the same."""
    rng = np.random.default_rng(seed)
    chosen = set(rng.choice(len(items), min(count, len(items)), replace=False).tolist())
    parts: tuple[list[Item], list[Item]] = ([], [])
    for number, item in enumerate(items):
        parts[number not in chosen].append(item)
    return parts
