"""Small changes of a C source: directions of comparisons, signs, conditions, limits, statements, states."""

import re
from collections.abc import Iterator
from dataclasses import dataclass

SWAPS = {
    "<=": ">=", ">=": "<=", "<": ">", ">": "<", "==": "!=", "!=": "==", "&&": "||", "||": "&&",
    "+": "-", "-": "+", "*": "/", "/": "*",
}  # fmt: skip
"""Binary operators, which stand between blanks. A comparison changes its direction: where exactly a limit
lies in float32 is told by the parity tests."""

LIMIT_STEP = 1.25
"""Factor by which a number is changed; 0 becomes 0.1."""

_LEFT_ALONE = re.compile(r"/\*.*?\*/|#[^\n]*|isfinite\(q->[^)]*\)", re.DOTALL)
"""Comments, directives, and sums that are only asked whether they are finite, whatever the signs."""

_CHANGES = (
    ("operator", re.compile(r"(?<= )(<=|>=|==|!=|&&|\|\||[<>+*/-])(?= )"), lambda m: SWAPS[m.group()]),
    ("negation", re.compile(r"!(?=[\w(])"), lambda m: ""),
    ("truth", re.compile(r"\b(true|false)\b"), lambda m: "false" if m.group() == "true" else "true"),
    ("limit", re.compile(r"\b\d+\.\d+f\b"), lambda m: _other_limit(m.group())),
    ("state", re.compile(r"(?<== )PERCH_(CUT|FAULT|BRAKE|HOLD|IDLE|APPROACH)(?=;)"), lambda m: "PERCH_FLIP"),
    ("reason", re.compile(r"\bPERCH_REASON_(?!NONE)\w+"), lambda m: "PERCH_REASON_NONE"),
    ("statement", re.compile(r"(?<=  )(memory|snapshot|motion|out)(->|\.)[\w.]+ = [^;]+;"), lambda m: ";"),
    ("statement", re.compile(r"(?<=  )(end_approach|begin_brake|begin_flip|arm)\([^;]*\);"), lambda m: ";"),
    ("statement", re.compile(r"(?<=  )return;"), lambda m: ";"),
)


@dataclass(frozen=True, slots=True)
class Mutant:
    """`text` in the place of the characters `start` to `end` of a file in ``core``."""

    file: str
    line: int
    kind: str
    start: int
    end: int
    text: str

    @property
    def function(self) -> str:
        """Near which others are noticed by the same tests."""
        return f"{self.line // 10}"

    def source(self, original: str) -> str:
        """The whole file with the change in it."""
        return original[: self.start] + self.text + original[self.end :]

    def shown(self, original: str) -> dict[str, str]:
        """Where, and the line before and after."""
        begin = original.rfind("\n", 0, self.start) + 1
        end = original.find("\n", self.end)
        after = original[begin : self.start] + self.text + original[self.end : end]
        before, after = (" ".join(text.split()) for text in (original[begin:end], after))
        return {"at": f"{self.file}:{self.line}", "kind": self.kind, "before": before, "after": after}


def mutants_of(file: str, source: str) -> Iterator[Mutant]:
    """All mutants of a C source, in the order of their kinds; comments and directives stay as they are."""
    code = _LEFT_ALONE.sub(lambda part: re.sub(r"[^\n]", "~", part.group()), source)
    for kind, pattern, change in _CHANGES:
        for found in pattern.finditer(code):
            line = source.count("\n", 0, found.start()) + 1
            yield Mutant(file, line, kind, found.start(), found.end(), change(found))


def _other_limit(number: str) -> str:
    value = float(number.removesuffix("f"))
    return f"{LIMIT_STEP * value if value else 0.1!r}f"
