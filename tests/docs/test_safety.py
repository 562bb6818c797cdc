"""docs/safety.md names every rule and every reason of the supervisor, and no other."""

import ast
import re
from collections.abc import Iterable, Iterator
from pathlib import Path

import perchhw.supervisor
from perchhw.supervisor.space import clear_of_walls
from tests.supervisor.deadline_table import deadline_table
from tests.supervisor.test_limits import AIR, LIMITS, at, judged

PAGE = (Path(__file__).parents[2] / "docs" / "safety.md").read_text(encoding="utf-8")
CODE = [ast.parse(path.read_text()) for path in Path(perchhw.supervisor.__file__).parent.glob("*.py")]
OUTSIDE_THE_SUPERVISOR = {"link_lost", "operator"}
"""Reasons that it is handed as they are, or that have no colon."""


def test_the_tables_name_every_rule_and_reason_that_the_code_has_and_no_other() -> None:
    rules, reasons = set(first_column("| rule | limit |")), set(first_column("| reason | when |"))
    assert len(rules) > 40
    assert not rules & reasons
    assert rules | reasons == rules_in_code() | fences() | reasons_in_code() | OUTSIDE_THE_SUPERVISOR


def test_the_table_of_deadlines_is_that_of_the_code() -> None:
    assert deadline_table() in PAGE, deadline_table()


def first_column(heading: str) -> list[str]:
    """What stands in backticks in the first column of the table that begins with `heading`."""
    _, _, table = PAGE.partition(f"\n{heading}")
    rows = table.partition("\n\n")[0].splitlines()[2:]
    return [name for row in rows for name in re.findall(r"`([a-z_]+)`", row.split("|")[1])]


def calls() -> Iterator[ast.Call]:
    return (node for tree in CODE for node in ast.walk(tree) if isinstance(node, ast.Call))


def makers() -> dict[str, int]:
    """What makes a violation, and which argument is its rule's name: also through other functions."""
    known, functions = {"Violation": 0}, []
    for tree in CODE:
        functions += [node for node in ast.walk(tree) if isinstance(node, ast.FunctionDef)]
    while True:
        found = {
            function.name: parameters.index(name.id)
            for function in functions
            for parameters in [[argument.arg for argument in function.args.args]]
            for name in names_given(ast.walk(function), known)
            if isinstance(name, ast.Name) and name.id in parameters
        }
        if found.keys() <= known.keys():
            return known
        known |= found


def names_given(nodes: Iterable[ast.AST], known: dict[str, int]) -> Iterator[ast.expr]:
    """The argument that names a rule, of each call of what makes violations."""
    for node in nodes:
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id in known:
            yield node.args[known[node.func.id]]


def rules_in_code() -> set[str]:
    """Names that stand in the code; those of the fences are made at run time."""
    given = list(names_given(calls(), makers()))
    made = {ast.unparse(name) for name in given if isinstance(name, ast.JoinedStr)}
    assert [name for name in made if not name.startswith("f'fence_")] == [], "run the rule, as `fences` does"
    return {str(name.value) for name in given if isinstance(name, ast.Constant)}


def fences() -> set[str]:
    """The rules that a drone breaks which flies at each of the walls."""
    flights = ((9.0, 0.0), (-9.0, 0.0), (0.0, 9.0), (0.0, -9.0))
    broken = [judged(clear_of_walls, AIR, LIMITS, **at(-2.0, 0.0, 1.0, vx, vy, 0.0)) for vx, vy in flights]
    return {violation.rule for violation in broken if violation is not None}


def reasons_in_code() -> set[str]:
    """What texts of the code begin with, up to a colon: reasons that no rule makes."""
    begin: list[str] = []
    for tree in CODE:
        skipped = {id(node.value) for node in ast.walk(tree) if isinstance(node, ast.Expr)}  # docstrings
        for node in ast.walk(tree):
            if isinstance(node, ast.JoinedStr) and isinstance(node.values[0], ast.Constant):
                begin.append(str(node.values[0].value))
            elif isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in skipped:
                begin.append(node.value)
    return {found[1] for text in begin if (found := re.match(r"([a-z_]+): ", text))}
