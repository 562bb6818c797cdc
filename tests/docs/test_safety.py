"""docs/safety.md names every rule of the supervisor: it is where an operator looks one up."""

import ast
from pathlib import Path

import perchhw.supervisor

PAGE = Path(__file__).parents[2] / "docs" / "safety.md"
MAKERS = ("Violation", "at_least", "at_most")
CODE = [ast.parse(path.read_text()) for path in Path(perchhw.supervisor.__file__).parent.glob("*.py")]


def test_every_rule_that_may_end_a_flight_stands_in_the_page() -> None:
    calls = [node for tree in CODE for node in ast.walk(tree) if isinstance(node, ast.Call) and node.args]
    named = [call.args[0] for call in calls if isinstance(call.func, ast.Name) and call.func.id in MAKERS]
    rules = {str(name.value) for name in named if isinstance(name, ast.Constant)}
    assert len(rules) > 30
    page = PAGE.read_text()
    assert not [rule for rule in sorted(rules) if f"`{rule}`" not in page]
