"""The long proof draws at least as many examples of every property as it promises."""

import ast
from collections.abc import Iterator

import pytest
from hypothesis import settings

from tests.conftest import REPOSITORY
from tests.drawn_examples import SOAK, USUAL, examples


@pytest.fixture
def soak() -> Iterator[None]:
    before = settings.get_current_profile_name()
    settings.load_profile("soak")
    yield
    settings.load_profile(before)


@pytest.mark.usefixtures("soak")
@pytest.mark.parametrize("count", [1, 15, 30, 300])
def test_a_soak_draws_no_fewer_than_it_says(count: int) -> None:
    assert settings().max_examples == SOAK
    assert examples(count) == max(100 * count, SOAK)


def test_no_test_sets_a_number_that_the_long_proof_could_not_raise() -> None:
    trees = [ast.parse(path.read_text()) for path in (REPOSITORY / "tests").rglob("*.py")]
    numbers = [
        keyword.value
        for tree in trees
        for node in ast.walk(tree)
        if isinstance(node, ast.Call)
        for keyword in node.keywords
        if keyword.arg == "max_examples"
    ]
    assert len(numbers) > 20
    assert not [ast.unparse(number) for number in numbers if isinstance(number, ast.Constant)]
    assert USUAL < SOAK
