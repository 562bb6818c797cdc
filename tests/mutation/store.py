"""Verdicts that are kept as they come, so that a run which was stopped goes on; and how far it is."""

import hashlib
import json
import sys
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from tests.conftest import REPOSITORY
from tests.mutation.mutant import Key, Mutant
from tests.mutation.session import Verdict


class Store:
    """Verdicts of this state of code and tests, one JSON line each.

    Args:
        out: folder of ``results.jsonl``.
        states: of each mutated file, a digest of all that verdicts on it depend on.
        again: take what was killed in another state, too.
    """

    def __init__(self, out: Path, states: Mapping[str, str], *, again: bool) -> None:
        self.verdicts: dict[Key, Verdict] = {}
        self._states = states
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


def state_of(places: Iterable[str], suffixes: frozenset[str] = frozenset({".py"})) -> str:
    """A digest of the sources in files or folders below the repository."""
    digest = hashlib.sha256()
    for place in places:
        path = REPOSITORY / place
        for source in sorted(path.rglob("*")) if path.is_dir() else [path]:
            if source.suffix in suffixes:
                digest.update(source.as_posix().encode() + b"\0" + source.read_bytes())
    return digest.hexdigest()[:16]


def progress() -> Progress:
    """How many mutants were tried, on stderr; without a refreshing thread, since the process forks."""
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
