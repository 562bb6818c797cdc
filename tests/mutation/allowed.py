"""Mutants that change nothing that a test could see, each with the reason why."""

import tomllib
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from tests.mutation.mutant import Mutant

FILE = Path(__file__).with_name("allowed.toml")


@dataclass(frozen=True, slots=True)
class Allowed:
    """Mutants with this change of this line in this function are equivalent, for `reason`."""

    file: str
    function: str
    before: str
    after: str
    reason: str

    def covers(self, mutant: Mutant) -> bool:
        """Whether this is the mutant."""
        return (self.file, self.function, self.before, self.after) == (
            mutant.file,
            mutant.function,
            mutant.before,
            mutant.after,
        )


def load_allowed(path: Path = FILE) -> list[Allowed]:
    """The list as written; a missing or empty reason is an error."""
    entries = [
        Allowed(**entry) for entry in tomllib.loads(path.read_text(encoding="utf-8")).get("mutant", [])
    ]
    for entry in entries:
        if not entry.reason.strip():
            raise ValueError(f"{path.name}: {entry.file}: {entry.before!r}: give the reason")
    return entries


def not_applicable(allowed: Iterable[Allowed], mutants: Iterable[Mutant], files: set[str]) -> list[Allowed]:
    """Entries for these files that fit no mutant: their code has changed."""
    present = {(m.file, m.function, m.before, m.after) for m in mutants}
    return [
        entry
        for entry in allowed
        if entry.file in files and (entry.file, entry.function, entry.before, entry.after) not in present
    ]
