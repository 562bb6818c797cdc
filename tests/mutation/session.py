"""All the trials of a session, some at a time, and what came of them."""

import os
import resource
import selectors
import sys
import tempfile
import time
from collections import defaultdict, deque
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from tests.mutation.mutant import Mutant
from tests.mutation.targets import Target
from tests.mutation.trial import Send, Trial, end, find_mutants, run_tests, start

FIND_LIMIT = 120.0
"""s of processor time to find mutants, and to run the tests on the code as it is."""

LEAST_LIMIT = 10.0
"""s of processor time that every mutant has, beside four times what the tests need without it."""

NO_TESTS_RAN = 5
"""pytest's exit code."""


class MutationError(Exception):
    """The tests do not pass on the code as it is, or cannot be run."""


@dataclass(slots=True)
class Verdict:
    """What became of a mutant: "killed", "timeout" or "survived"; `by` is the test that noticed."""

    outcome: str
    by: str = ""


@dataclass(slots=True)
class Suite:
    """A target's tests on the code as it is, and what they found lately."""

    target: Target
    durations: dict[str, float]
    cpu_limit: float
    killers: defaultdict[str, deque[str]] = field(
        default_factory=lambda: defaultdict(lambda: deque(maxlen=4))
    )
    """Tests that noticed mutants of a function; they are tried first on its next one."""


def _alone(work: Callable[[Send], None], what: str) -> tuple[Any, float]:
    """`work` in a process of its own: what it sent, and the processor time (s) that it took."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    with tempfile.TemporaryFile() as log:
        trial = start(work, log.fileno(), FIND_LIMIT)
        while piece := os.read(trial.result, 1 << 20):
            trial.received += piece
        result = end(trial)
        log.seek(0)
        printed = log.read().decode(errors="replace")
    if result is None:
        raise MutationError(f"{what} ended without a result\n{printed}")
    if isinstance(result, dict) and result["code"] != 0:
        raise MutationError(f"{what} is red on the code as it is: {result['failed']}\n{printed}")
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return result, after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def prepare(target: Target) -> tuple[Suite, list[Mutant]]:
    """The target's tests, green on the code as it is, and its mutants."""
    found, _ = _alone(lambda send: find_mutants(target, send), f"finding mutants of {target.file}")
    green, cpu = _alone(lambda send: run_tests(target, None, send), f"the tests of {target.file}")
    return Suite(target, green["durations"], LEAST_LIMIT + 4.0 * cpu), [Mutant(**one) for one in found]


def try_all(work: Iterable[tuple[Suite, Mutant]], jobs: int) -> Iterator[tuple[Mutant, Verdict]]:
    """Try mutants, `jobs` at a time, and yield each with its verdict as it comes."""
    queue = iter(work)
    with selectors.DefaultSelector() as running, Path(os.devnull).open("wb") as silence:
        while True:
            while len(running.get_map()) < jobs and (following := next(queue, None)) is not None:
                trial = _begin(*following, silence.fileno())
                running.register(trial.result, selectors.EVENT_READ, (trial, *following))
            if not running.get_map():
                return
            for key in _ended(running):
                trial, suite, mutant = key.data
                running.unregister(trial.result)
                verdict = _verdict(end(trial))
                if verdict.by:
                    killers = suite.killers[mutant.function]
                    if verdict.by in killers:
                        killers.remove(verdict.by)
                    killers.append(verdict.by)
                yield mutant, verdict


def _begin(suite: Suite, mutant: Mutant, silence: int) -> Trial:
    sys.stdout.flush()
    sys.stderr.flush()
    first = tuple(suite.killers[mutant.function])
    return start(
        lambda send: run_tests(suite.target, mutant, send, first, suite.durations), silence, suite.cpu_limit
    )


def _ended(running: selectors.BaseSelector) -> list[selectors.SelectorKey]:
    """Trials that closed their pipe or had their time; what they sent is kept."""
    over = []
    for key, _ in running.select(timeout=1.0):
        piece = os.read(key.fd, 1 << 16)
        key.data[0].received += piece
        if not piece:
            over.append(key)
    now = time.monotonic()
    late = [key for key in running.get_map().values() if now > key.data[0].deadline and key not in over]
    return over + late


def _verdict(result: dict[str, Any] | None) -> Verdict:
    if result is None:
        return Verdict("timeout")
    if result["code"] == NO_TESTS_RAN:
        raise MutationError("no test was collected; name the tests of each target in targets.py")
    if result["code"] == 0:
        return Verdict("survived")
    return Verdict("killed", result["failed"])
