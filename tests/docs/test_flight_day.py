"""The day of docs/flight_day.md, flown from its first command to its last in one lab, in the page's order."""

import io
import re
import shlex
from collections.abc import Iterator
from contextlib import redirect_stderr, redirect_stdout
from dataclasses import dataclass
from pathlib import Path

import pytest

from perchhw.cli.main import run
from perchhw.lab_process import FREE_PORTS, LOCKSTEP, SimulatedLab
from tests.conftest import REPOSITORY
from tests.docs.test_documented_commands import LAB, console_lines, files
from tests.report.chromium import assert_they_fit

PAGE = REPOSITORY / "docs" / "flight_day.md"
LINES = console_lines(PAGE)
ASKING = ("check hover", "fly")
"""Verbs that ask for the drone on its mark: here nobody can answer."""
SHORTER = {"survey_at=20": "survey_at=3:2.5", "check hover": "check hover --seconds 5"}
"""What gives a person time to type, and the check its precision, is not tested here."""
ATTEMPTS = Path("runs/campaign-day/attempts")
NOT_RUN = {
    "perchhw sim lab --lab lab.toml": "served here with the survey besides",
    "perchhw stop --lab lab.toml": "typed and not yet entered; that of the evening is run",
    "perchhw view RUN": "opens a window; here it is saved to a file, and tests/view reads such files",
    "perchhw gap find --data FLIGHTS --vehicle VEHICLE": "flights of several days: tests/gap/test_find.py",
}
"""Commands that the page names outside its consoles, and why they are not run here."""


def named() -> set[str]:
    """Whole commands outside the consoles: indented, or within a sentence."""
    text = re.sub(r"```.*?```", "", PAGE.read_text(encoding="utf-8"), flags=re.DOTALL)
    found = re.findall(r"^ {4,}(perchhw .*)$", text, re.MULTILINE) + re.findall(r"`(perchhw [^`]*)`", text)
    return {" ".join(command.split()) for command in found if len(command.split()) > 2}


def test_every_command_is_run_or_there_is_a_reason() -> None:
    assert named() == NOT_RUN.keys()


@dataclass(frozen=True)
class Ended:
    """A command of the page as it ended.

    Attributes:
        verb: its first word. code: its exit code. said: on both streams.
    """

    verb: str
    code: int
    said: str


@pytest.fixture(scope="module")
def day(tmp_path_factory: pytest.TempPathFactory) -> Iterator[dict[str, Ended]]:
    """Every command of the page's consoles, entered in its order in one folder."""
    served = [line.removeprefix(LAB) for line in LINES if line.startswith(LAB)][-1]
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(tmp_path_factory.mktemp("day"))
        for name, content in files(PAGE).items():
            Path(name).write_text(content, encoding="utf-8")
        with SimulatedLab("lab", (*words_of(served), *FREE_PORTS, *LOCKSTEP, "--seed", "3")):
            yield {line: enter(line) for line in LINES if not line.startswith(LAB)}


def words_of(line: str) -> list[str]:
    for shown, shorter in SHORTER.items():
        line = line.replace(shown, shorter)
    return shlex.split(line)


def enter(line: str) -> Ended:
    """Run one command of the page."""
    program, *words = words_of(line)
    assert program == "perchhw"
    words += ["--yes"] if " ".join(words).startswith(ASKING) else []
    words = [str(max(ATTEMPTS.iterdir())) if word == "RUN" else word for word in words]
    said = io.StringIO()
    with redirect_stdout(said), redirect_stderr(said):
        code = run(words)
    return Ended(words[0], code, said.getvalue())


def test_every_command_does_what_the_page_says(day: dict[str, Ended]) -> None:
    for line, ended in day.items():
        allowed = {0}
        if "outcome: " in ended.said and "aborted" not in ended.said:
            allowed = {0, 1}  # a landing may fail
        if ended.verb == "doctor":
            allowed = {1}  # the flight of the calibration has left the drone locked, as the page says
            assert re.findall(r"^bad +(.*)$", ended.said, re.MULTILINE) == [
                "drone_state: locked, cannot arm (wanted: can arm)"
            ]
        assert ended.code in allowed, f"{line}\n{ended.said}"


def test_every_page_of_the_day_fits_a_phone(day: dict[str, Ended], tmp_path: Path) -> None:
    pages = sorted(Path.cwd().rglob("*.html"))
    assert {"report.html", "landings.html"} == {page.name for page in pages}
    for text in (page.read_text(encoding="utf-8") for page in pages):
        assert text.count("<svg ") == text.count('<svg role="img" aria-label="') > 0
    assert_they_fit(pages, tmp_path)
