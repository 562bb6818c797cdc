"""``--view`` with and without its kind."""

import pytest

from perchhw.cli.main import run as perchhw
from perchhw.cli.view_option import complete_view_option


@pytest.mark.parametrize(
    ("given", "completed"),
    [
        ("fly --view --speed 2.5", "fly --view desktop --speed 2.5"),
        ("fly --view web --speed 2.5", "fly --view web --speed 2.5"),
        ("fly --speed 2.5 --view", "fly --speed 2.5 --view desktop"),
        ("campaign run --view desktop FILE", "campaign run --view desktop FILE"),
        ("fly --speed 2.5 -- --view", "fly --speed 2.5 -- --view"),
        ("view runs", "view runs"),
    ],
)
def test_a_view_that_stands_alone_is_a_window(given: str, completed: str) -> None:
    assert complete_view_option(given.split()) == completed.split()


@pytest.mark.parametrize("verb", [("fly",), ("campaign", "run"), ("rehearse",)])
def test_the_verbs_that_fly_have_it(verb: tuple[str, ...], capsys: pytest.CaptureFixture[str]) -> None:
    assert perchhw([*verb, "--help"]) == 0
    assert "--view" in capsys.readouterr().out
