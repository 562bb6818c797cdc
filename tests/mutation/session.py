"""All the trials of the targets that have their tests in common, some at a time, and what came of them."""

import json
import os
import resource
import selectors
import sys
import tempfile
from collections import defaultdict, deque
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NoReturn, TypeAlias

from tests.mutation.mutant import Mutant
from tests.mutation.targets import Target
from tests.mutation.trial import Send, Trial, end, find_mutants, run_tests, start
from tests.mutation.warm import Collected, collect

RUN_LIMIT = 120.0
"""s of processor time to find mutants, and to run the tests on the code as it is."""

LEAST_LIMIT = 5.0
"""s of processor time that every mutant has, beside what the tests need without it while they are watched."""

NO_TESTS_RAN = 5
"""pytest's exit code."""

Begin: TypeAlias = Callable[[Mutant, int], Trial]
"""Starts the trial of a mutant, which may print to a file descriptor."""


class MutationError(Exception):
    """The tests do not pass on the code as it is, or cannot be run."""


@dataclass(slots=True)
class Verdict:
    """What became of a mutant: "killed", "timeout" or "survived"; `by` is the test that noticed."""

    outcome: str
    by: str = ""


@dataclass(slots=True)
class Known:
    """What is known of tests: how long each takes, what all may take, and what they noticed lately."""

    durations: dict[str, float]
    cpu_limit: float
    killers: defaultdict[tuple[str, str], deque[str]] = field(
        default_factory=lambda: defaultdict(lambda: deque(maxlen=4))
    )
    """Tests that noticed mutants of a function; they are tried first on its next one."""

    def likely(self, mutant: Mutant) -> tuple[str, ...]:
        """Tests to begin with."""
        return tuple(self.killers[mutant.file, mutant.function])

    def noticed(self, mutant: Mutant, test: str) -> None:
        """Remember the test that noticed a mutant."""
        killers = self.killers[mutant.file, mutant.function]
        if test in killers:
            killers.remove(test)
        killers.append(test)


def _alone(work: Callable[[Send], None], what: str) -> tuple[Any, float]:
    """`work` in a process of its own: what it sent, and the processor time (s) that it took."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    with tempfile.TemporaryFile() as log:
        trial = start(work, log.fileno(), RUN_LIMIT)
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


def mutants_in(targets: Sequence[Target]) -> list[Mutant]:
    """All mutants of the targets."""
    found, _ = _alone(lambda send: find_mutants(targets, send), "finding mutants")
    return [Mutant(**one) for one in found]


def try_all(
    targets: Sequence[Target], mutants: Sequence[Mutant], jobs: int
) -> Iterator[tuple[Mutant, Verdict]]:
    """Try mutants of targets with the same tests, `jobs` at a time, and yield each with its verdict.

    Raises:
        MutationError: the tests are not green on the code as it is.
    """
    lines = _from_a_fork(lambda say: _warm(targets, mutants, jobs, say), f"{targets[0].tests}")
    known = Known(**next(lines))  # Without one, the fork has failed, and this raises what it said.
    left = dict(enumerate(mutants))
    for line in lines:
        verdict = Verdict(line["outcome"], line["by"])
        mutant = left.pop(line["at"])
        yield mutant, verdict
    by_file = {target.file: target for target in targets}

    def begin(mutant: Mutant, log: int) -> Trial:
        target, first = by_file[mutant.file], known.likely(mutant)
        return start(
            lambda send: run_tests(target, mutant, send, first, known.durations), log, known.cpu_limit
        )

    yield from some_at_a_time(list(left.values()), begin, jobs, known)


def _warm(
    targets: Sequence[Target], mutants: Sequence[Mutant], jobs: int, say: Callable[[Any], None]
) -> None:
    """Say what is known of the tests, and then the verdicts of the mutants that need no new import."""

    def use(collected: Collected) -> None:
        if not collected.items:
            raise MutationError("no test was collected; name the tests of each target in targets.py")
        green, cpu = _alone(collected.run_all, "the test run")
        for test, places in green["calls"].items():
            for place in places:
                collected.callers[tuple(place)].add(test)
        known = Known(green["durations"], LEAST_LIMIT + cpu)
        say({"durations": known.durations, "cpu_limit": known.cpu_limit})

        def begin(mutant: Mutant, log: int) -> Trial:
            first = known.likely(mutant)
            return start(
                lambda send: collected.run(mutant, send, first, known.durations), log, known.cpu_limit
            )

        numbers = {mutant.key: at for at, mutant in enumerate(mutants)}
        inner = [mutant for mutant in mutants if collected.can_try(mutant)]
        for mutant, verdict in some_at_a_time(inner, begin, jobs, known):
            say({"at": numbers[mutant.key], "outcome": verdict.outcome, "by": verdict.by})

    code = collect(targets, use)
    if code != 0:
        raise MutationError(f"pytest ended with code {code}")


def _from_a_fork(work: Callable[[Callable[[Any], None]], None], what: str) -> Iterator[Any]:
    """What `work` says in a process of its own, as it is said."""
    reader, writer = os.pipe()
    with tempfile.TemporaryFile() as log:
        pid = _fork(work, reader, writer, log.fileno())
        os.close(writer)
        with os.fdopen(reader, encoding="utf-8") as said:
            try:
                yield from map(json.loads, said)
            finally:
                _, status = os.waitpid(pid, 0)
        if status != 0:
            log.seek(0)
            raise MutationError(f"{what}: {log.read().decode(errors='replace')}")


def _fork(work: Callable[[Callable[[Any], None]], None], reader: int, writer: int, log: int) -> int:
    sys.stdout.flush()
    sys.stderr.flush()
    pid = os.fork()
    if pid == 0:
        _work_and_exit(work, reader, writer, log)
    return pid


def _work_and_exit(
    work: Callable[[Callable[[Any], None]], None], reader: int, writer: int, log: int
) -> NoReturn:
    code = 1
    try:
        os.close(reader)
        os.dup2(log, 1)
        os.dup2(log, 2)
        with os.fdopen(writer, "w", encoding="utf-8") as pipe:

            def say(message: Any) -> None:
                pipe.write(json.dumps(message) + "\n")
                pipe.flush()

            work(say)
        code = 0
    finally:
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(code)


def some_at_a_time(
    mutants: Sequence[Mutant], begin: Begin, jobs: int, known: Known
) -> Iterator[tuple[Mutant, Verdict]]:
    """Try mutants, `jobs` at a time, and yield each with its verdict as it comes."""
    queue = iter(mutants)
    with selectors.DefaultSelector() as running, Path(os.devnull).open("wb") as silence:
        while True:
            while len(running.get_map()) < jobs and (following := next(queue, None)) is not None:
                sys.stdout.flush()
                sys.stderr.flush()
                trial = begin(following, silence.fileno())
                running.register(trial.result, selectors.EVENT_READ, (trial, following))
            if not running.get_map():
                return
            for key in _ended(running):
                trial, mutant = key.data
                running.unregister(trial.result)
                verdict = _verdict(end(trial))
                if verdict.by:
                    known.noticed(mutant, verdict.by)
                yield mutant, verdict


def _ended(running: selectors.BaseSelector) -> list[selectors.SelectorKey]:
    """Trials that closed their pipe or had their time; what they sent is kept."""
    over = []
    for key, _ in running.select(timeout=1.0):
        piece = os.read(key.fd, 1 << 16)
        key.data[0].received += piece
        if not piece:
            over.append(key)
    late = [key for key in running.get_map().values() if key not in over and key.data[0].waits_in_vain()]
    return over + late


def _verdict(result: dict[str, Any] | None) -> Verdict:
    if result is None:
        return Verdict("timeout")
    if result["code"] == NO_TESTS_RAN:
        raise MutationError("no test was collected; name the tests of each target in targets.py")
    if result["code"] == 0:
        return Verdict("survived")
    return Verdict("killed", result["failed"])
