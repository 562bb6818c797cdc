"""One small change of one source file."""

import ast
from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Any, TypeAlias

from tests.mutation.operators import changes

Key: TypeAlias = tuple[str, str, str, str, int]
"""File, function, source before and after, and ordinal of a mutant."""


@dataclass(frozen=True, slots=True)
class Mutant:
    """A change of a source file, and what it is recognised by when the file moves on.

    Attributes:
        file: path below the repository, with slashes.
        line: where the change begins.
        function: qualified name of the function or class around it; "" at the top of the module.
        kind: what sort of change.
        before, after: the source of the changed lines on one line, as it is and as it becomes.
        ordinal: number among the changes that look the same.
        start, end: the replaced bytes of the file. text: what they are replaced by.
    """

    file: str
    line: int
    function: str
    kind: str
    before: str
    after: str
    ordinal: int
    start: int
    end: int
    text: str

    @property
    def key(self) -> Key:
        """What stays when lines move."""
        return (self.file, self.function, self.before, self.after, self.ordinal)

    def source(self, original: str) -> str:
        """The whole file with the change in it."""
        data = original.encode()
        return (data[: self.start] + self.text.encode() + data[self.end :]).decode()


def mutants_of(file: str, source: str, namespace: dict[str, Any]) -> list[Mutant]:
    """All mutants of a module that still parse, in the order of their lines.

    Args:
        file: its path below the repository.
        source: its text.
        namespace: the names of the imported module, which tell enumerations and commands.
    """
    data = source.encode()
    starts = [0]
    for line in data.splitlines(keepends=True):
        starts.append(starts[-1] + len(line))
    found: dict[tuple[int, int, str], Mutant] = {}
    for change in changes(ast.parse(source), source, namespace):
        first, last = change.node.lineno, change.node.end_lineno or change.node.lineno
        start = starts[first - 1] + change.node.col_offset
        end = starts[last - 1] + (change.node.end_col_offset or 0)
        head, tail = data[starts[first - 1] : start].decode(), data[end : starts[last]].decode()
        before = on_one_line(data[starts[first - 1] : starts[last]].decode())
        after = on_one_line(head + change.text + tail)
        mutant = Mutant(file, first, change.function, change.kind, before, after, 0, start, end, change.text)
        if before != after and (start, end, change.text) not in found and _parses(mutant.source(source)):
            found[start, end, change.text] = mutant
    return numbered(found.values())


def numbered(mutants: Iterable[Mutant]) -> list[Mutant]:
    """Mutants in the order of their places, those that look the same with numbers."""
    seen: Counter[Key] = Counter()
    found = []
    for mutant in sorted(mutants, key=lambda mutant: (mutant.start, mutant.end, mutant.text)):
        found.append(replace(mutant, ordinal=seen[mutant.key]))
        seen[mutant.key] += 1
    return found


def on_one_line(text: str) -> str:
    """`text` with one blank for all between two words."""
    return " ".join(text.split())


def _parses(source: str) -> bool:
    try:
        compile(source, "mutant", "exec", dont_inherit=True)
    except SyntaxError:
        return False
    return True
