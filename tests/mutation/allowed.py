"""Mutants that change nothing that a test could see, each with the reason why."""

import tomllib
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from tests.mutation.mutant import Mutant

FILE = Path(__file__).with_name("allowed.toml")


@dataclass(frozen=True, slots=True)
class Allowed:
    """Mutants of one line of a function that are equivalent, for one reason.

    Attributes:
        file: path below the repository. function: qualified name.
        before: the source of the changed lines, on one line.
        after: what they become, one entry for each mutant.
        reason: why no test can see it.
    """

    file: str
    function: str
    before: str
    after: tuple[str, ...]
    reason: str

    def covers(self, mutant: Mutant) -> bool:
        """Whether `mutant` is one of them."""
        place = (mutant.file, mutant.function, mutant.before)
        return place == (self.file, self.function, self.before) and mutant.after in self.after


def load_allowed(path: Path = FILE) -> list[Allowed]:
    """The list as written.

    Raises:
        ValueError: an entry has no reason.
    """
    entries = []
    for entry in tomllib.loads(path.read_text(encoding="utf-8"))["mutant"]:
        if not entry["reason"].strip():
            raise ValueError(f"{path.name}: {entry['file']}: {entry['before']!r}: give the reason")
        entries.append(Allowed(**{**entry, "after": tuple(entry["after"])}))
    return entries


def not_applicable(allowed: Iterable[Allowed], mutants: Iterable[Mutant], files: set[str]) -> list[str]:
    """The changes in these files that no mutant makes any more: their code is another."""
    present = {(mutant.file, mutant.function, mutant.before, mutant.after) for mutant in mutants}
    return [
        f"{entry.file}: {entry.function}: {entry.before} -> {after}"
        for entry in allowed
        for after in entry.after
        if entry.file in files and (entry.file, entry.function, entry.before, after) not in present
    ]
