"""``--view`` with and without its kind."""

import urllib.request
from pathlib import Path
from urllib.parse import parse_qs, urlsplit

import pytest

from perchhw.cli.main import run as perchhw
from perchhw.cli.view_option import ViewKind, complete_view_option, live_view
from perchhw.screen.lines import Lines
from tests.patience import until


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


class Told(Lines):
    """Lines that remember where the flight is seen."""

    def __init__(self) -> None:
        super().__init__()
        self.told: list[str] = []

    def viewed(self, text: str) -> None:
        self.told.append(text)


@pytest.mark.soak
def test_the_address_of_a_view_is_told_to_who_flies(tmp_path: Path) -> None:
    display = Told()
    with live_view(ViewKind.WEB, tmp_path, display):
        until(lambda: bool(display.told))
        address = display.told[0].removeprefix("view: ")
        with urllib.request.urlopen(address, timeout=60) as page:
            assert parse_qs(urlsplit(page.url).query)["url"][0].startswith("rerun+http://127.0.0.1:")


def test_a_view_that_does_not_open_says_why(tmp_path: Path) -> None:
    (tmp_path / "run.json").write_text("no JSON")
    (tmp_path / "series.mcap").touch()
    display = Told()
    with live_view(ViewKind.WEB, tmp_path, display):
        until(lambda: bool(display.told))
    assert display.told[0].startswith("no view: ")
    assert "error:" not in display.told[0]
    assert "run.json" in display.told[0]
