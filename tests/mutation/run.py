"""A session from the choice of the mutants to the document."""

import hashlib
import json
import sys
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

# Loaded once here and shared by all the processes that are forked. Nothing of the mutated code is.
import numba  # noqa: F401
import numpy as np
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from tests.conftest import REPOSITORY
from tests.mutation.allowed import load_allowed
from tests.mutation.document import document_of
from tests.mutation.mutant import Key, Mutant
from tests.mutation.session import Verdict, mutants_in, try_all
from tests.mutation.targets import Target, targets

SOURCES = ("onboard", "mocap_bridge", "perchhw/supervisor", "tests/mutation")
"""Folders whose change makes earlier results void, beside the target's own tests."""


def run(
    names: Sequence[str], sample: int | None, seed: int, jobs: int, out: Path, *, again: bool
) -> dict[str, Any]:
    """Try all mutants, or `sample` of them, and return the document that is printed."""
    chosen = targets(names)
    every = mutants_in(chosen)
    asked = drawn(every, sample, seed)
    store = _Store(out, chosen, again=again)
    open_ = [mutant for mutant in asked if mutant.key not in store.verdicts]
    with _progress() as bar:
        trying = bar.add_task("mutants", total=len(asked), completed=len(asked) - len(open_))
        for tests in dict.fromkeys(target.tests for target in chosen):
            sharing = [target for target in chosen if target.tests == tests]
            files = {target.file for target in sharing}
            mutants = [mutant for mutant in open_ if mutant.file in files]
            for mutant, verdict in try_all(sharing, mutants, jobs) if mutants else ():
                store.keep(mutant, verdict)
                bar.advance(trying)
                bar.refresh()
    document = document_of(every, asked, store.verdicts, load_allowed())
    return {"seed": None if sample is None else seed, **document}


def _progress() -> Progress:
    # Without a refreshing thread: the process forks.
    return Progress(
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeRemainingColumn(),
        console=Console(file=sys.stderr),
        auto_refresh=False,
        redirect_stdout=False,
        redirect_stderr=False,
    )


def drawn(every: list[Mutant], sample: int | None, seed: int) -> list[Mutant]:
    """All mutants, or `sample` of them, in their order."""
    if sample is None or sample >= len(every):
        return every
    picked = np.random.default_rng(seed).choice(len(every), sample, replace=False)
    return [every[at] for at in sorted(picked)]


class _Store:
    """Verdicts of this state of code and tests, one JSON line each, kept as they come."""

    def __init__(self, out: Path, chosen: Iterable[Target], *, again: bool) -> None:
        self.verdicts: dict[Key, Verdict] = {}
        self._states = {target.file: state_of(target) for target in chosen}
        self._path = out / "results.jsonl"
        out.mkdir(parents=True, exist_ok=True)
        for key, row in self._last_rows().items():
            fits = row["state"] == self._states.get(row["file"])
            if fits or (again and row["outcome"] != "survived"):
                self.verdicts[key] = Verdict(row["outcome"], row["by"])

    def _last_rows(self) -> dict[Key, dict[str, Any]]:
        """What was written last of each mutant; a line that was being written at a stop is not there."""
        if not self._path.exists():
            return {}
        text = self._path.read_text(encoding="utf-8")
        whole = text[: text.rfind("\n") + 1]
        if whole != text:
            self._path.write_text(whole, encoding="utf-8")
        rows = [json.loads(line) for line in whole.splitlines()]
        return {
            (row["file"], row["function"], row["before"], row["after"], row["ordinal"]): row for row in rows
        }

    def keep(self, mutant: Mutant, verdict: Verdict) -> None:
        """Remember a verdict."""
        self.verdicts[mutant.key] = verdict
        row = {
            "state": self._states[mutant.file],
            "file": mutant.file,
            "function": mutant.function,
            "before": mutant.before,
            "after": mutant.after,
            "ordinal": mutant.ordinal,
            "outcome": verdict.outcome,
            "by": verdict.by,
        }
        with self._path.open("a", encoding="utf-8") as lines:
            lines.write(json.dumps(row) + "\n")


def state_of(target: Target) -> str:
    """A digest of all that the verdicts on a target depend on."""
    digest = hashlib.sha256()
    for place in (*SOURCES, *target.tests):
        path = REPOSITORY / place
        for source in sorted(path.rglob("*.py")) if path.is_dir() else [path]:
            digest.update(source.as_posix().encode() + b"\0" + source.read_bytes())
    return digest.hexdigest()[:16]
