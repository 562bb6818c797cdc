"""Small changes of a C source: directions of comparisons, signs, conditions, limits, statements, states."""

import re

from tests.mutation.mutant import Mutant, numbered, on_one_line

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


_FUNCTION = re.compile(r"^\w[^;{}]*?\b(\w+)\([^;{}]*\) \{", re.MULTILINE)
"""The head of a function, with its name."""


def mutants_of(file: str, source: str) -> list[Mutant]:
    """All mutants of a C source (ASCII), in the order of their places; comments and directives stay."""
    code = _LEFT_ALONE.sub(lambda part: re.sub(r"[^\n]", "~", part.group()), source)
    heads = [(found.start(), found.group(1)) for found in _FUNCTION.finditer(code)]

    def mutant(kind: str, start: int, end: int, text: str) -> Mutant:
        first, last = source.rfind("\n", 0, start) + 1, source.find("\n", end)
        before, after = source[first:last], source[first:start] + text + source[end:last]
        line = source.count("\n", 0, start) + 1
        function = next((name for at, name in reversed(heads) if at <= start), "")
        return Mutant(
            file, line, function, kind, on_one_line(before), on_one_line(after), 0, start, end, text
        )

    return numbered(
        mutant(kind, found.start(), found.end(), change(found))
        for kind, pattern, change in _CHANGES
        for found in pattern.finditer(code)
    )


def _other_limit(number: str) -> str:
    value = float(number.removesuffix("f"))
    return f"{LIMIT_STEP * value if value else 0.1!r}f"
