"""What a mutation changes, shown on a few lines of source."""

from enum import Enum
from textwrap import dedent
from typing import Any

import pytest

from tests.mutation.mutant import mutants_of


class Colour(Enum):
    RED = 0
    GREEN = 1
    BLUE = 2


class Go: ...


class Stop: ...


def left(x: float) -> float:
    return x


def right(x: float) -> float:
    return -x


NAMES: dict[str, Any] = {"Colour": Colour, "Go": Go, "Stop": Stop, "left": left, "right": right}


def changed(source: str, kind: str) -> set[str]:
    """What the changed lines become, for one kind of change."""
    mutants = mutants_of("x.py", dedent(source).strip() + "\n", NAMES)
    return {mutant.after for mutant in mutants if mutant.kind == kind}


def in_function(line: str) -> str:
    return f"def f(a, b, c):\n    {line}\n"


@pytest.mark.parametrize(
    ("line", "kind", "expected"),
    [
        ("g(a < b)", "operator", {"g(a <= b)", "g(a > b)"}),
        ("g(a >= b)", "operator", {"g(a > b)", "g(a <= b)"}),
        ("g(a == b)", "operator", {"g(a != b)"}),
        ("g(a is not b)", "operator", {"g(a is b)"}),
        ("a < b <= c", "operator", {"a <= b <= c", "a > b <= c", "a < b < c", "a < b >= c"}),
        ("g((a + b) * c)", "operator", {"g((a - b) * c)", "g((a + b) / c)"}),
        ("g(-a)", "sign", {"g((a))"}),
        ("g(not a)", "sign", {"g((a))"}),
        ("g(0.5)", "constant", {"g(0.525)", "g(0.475)"}),
        ("g(0.0)", "constant", {"g(1.0)", "g(-1.0)"}),
        ("g(3)", "constant", {"g(4)", "g(2)"}),
        ("g(True)", "constant", {"g(False)"}),
        ("g('text', f'{a:.3f}')", "constant", set()),
        ("g(a and b)", "logic", {"g((a or b))"}),
        ("g(a and b and c)", "operand removed", {"g((b and c))", "g((a and c))", "g((a and b))"}),
        ("g(a if b else c)", "condition", {"g(a if True else c)", "g(a if False else c)"}),
        ("g([x for x in a if b])", "condition", {"g([x for x in a if True])", "g([x for x in a if False])"}),
        ("g(a)", "statement removed", {"pass"}),
        ("b = a", "statement removed", {"pass"}),
        ("return", "statement removed", {"pass"}),
        ("return a", "return", {"return None"}),
        ("return a < b", "return", {"return True", "return False"}),
        ("g(min(a, b))", "call", {"g(max(a, b))"}),
        ("g(abs(a))", "call", {"g((a))"}),
        ("g(a in (b, c))", "element removed", {"g(a in (c,))", "g(a in (b,))"}),
        ("g((Go(), b))", "element removed", {"g((b,))"}),
        ("g(replace(a, b=1, c=a))", "field removed", {"g(replace(a, c=a))", "g(replace(a, b=1))"}),
        ("g(Colour.RED)", "member", {"g(Colour.GREEN)", "g(Colour.BLUE)"}),
        ("g(Go())", "action", {"g(Stop())"}),
        ("g(left(a))", "action", {"g(right(a))"}),
        ("b: dict[int, int] = a", "constant", set()),
    ],
)  # fmt: skip
def test_changes_of_a_line(line: str, kind: str, expected: set[str]) -> None:
    assert changed(in_function(line), kind) == expected


def test_conditions_are_forced() -> None:
    source = in_function("if a:\n        g()\n    while b:\n        g()")
    assert changed(source, "condition") == {"if True:", "if False:", "while False:"}


def test_rules_are_taken_from_a_tuple() -> None:
    assert changed("RULES: tuple = (one, two, *MORE)", "element removed") == {
        "RULES: tuple = (two, *MORE)",
        "RULES: tuple = (one, *MORE)",
        "RULES: tuple = (one, two)",
    }


def test_what_is_only_listed_for_import_stays() -> None:
    assert mutants_of("x.py", '__all__ = ["one", "two"]\n', {}) == []


def test_numbers_of_an_enumeration_are_swapped_where_they_are_used() -> None:
    source = """
        RED = int(Colour.RED)
        GREEN = int(Colour.GREEN)
        BLUE = int(Colour.BLUE)
        def f(a):
            a.colour = GREEN
    """
    assert {"a.colour = RED", "a.colour = BLUE"} <= changed(source, "member")


def test_cases_are_changed() -> None:
    source = """
        def f(a):
            match a:
                case Colour.RED | Colour.GREEN:
                    g()
                    h()
                case _:
                    pass
    """
    assert changed(source, "case removed") == {"pass"}
    assert changed(source, "alternative removed") == {"case Colour.RED:", "case Colour.GREEN:"}
    assert "case Colour.RED | Colour.BLUE:" in changed(source, "member")


def test_a_mutant_is_the_source_with_that_change_and_no_other() -> None:
    source = "def f(a, ä):\n    return a < ä  # ü\n"
    for mutant in mutants_of("x.py", source, {}):
        lines = mutant.source(source).splitlines()
        assert lines[0] == "def f(a, ä):"
        assert len(lines) == 2
        assert mutant.line == 2
        assert " ".join(lines[1].split()) == mutant.after != mutant.before == "return a < ä # ü"


def test_two_that_look_alike_are_told_apart_and_keep_their_names_when_lines_move() -> None:
    source = "def f(a):\n    g(1)\n    g(1)\n"
    keys = [mutant.key for mutant in mutants_of("x.py", source, {})]
    assert len(keys) == len(set(keys))
    assert [mutant.key for mutant in mutants_of("x.py", "# new\n\n" + source, {})] == keys
