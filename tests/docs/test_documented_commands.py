"""Every command that the documentation shows works: console lines run, synopses agree with ``--help``."""

import re
import shlex
from collections.abc import Iterator
from pathlib import Path

import pytest

from perchhw.cli.main import run
from perchhw.lab_process import FREE_PORTS, LOCKSTEP, SimulatedLab
from tests.conftest import REPOSITORY
from tests.patience import patient_uri

PAGES = [
    *(REPOSITORY / name for name in ("README.md", "CONTRIBUTING.md", "CHANGELOG.md", "examples/README.md")),
    *sorted((REPOSITORY / "docs").rglob("*.md")),
]
RUN_BY_CI = {"make demo", "make test"}
LAB = "perchhw sim lab"
BENCH, HANDS = "perchhw sim bench --pace 10", "tcp://127.0.0.1:40123"
LAB_FILE = "--lab lab.toml"
DRONE, MOCAP = "udp://127.0.0.1:19850", "vicon://127.0.0.1:18801?subject=cf1"


def console_lines(page: Path) -> list[str]:
    """Commands after ``$`` in the page's console blocks."""
    blocks = re.findall(r"```console\n(.*?)```", page.read_text(encoding="utf-8"), re.DOTALL)
    lines = [line.strip() for block in blocks for line in block.splitlines()]
    return [line[2:] for line in lines if line.startswith("$ ")]


def run_here(page: Path) -> set[str]:
    """Those that are not run by CI as they stand, and are no servers."""
    return set(console_lines(page)) - RUN_BY_CI - {LAB, BENCH}


def files(page: Path) -> dict[str, str]:
    """Files that the page shows: blocks whose first line is a comment with a name."""
    blocks = re.findall(r"```toml\n# (\w+\.toml)\n(.*?)```", page.read_text(encoding="utf-8"), re.DOTALL)
    return dict(blocks)


def synopses(page: Path) -> list[str]:
    """Lines of code that show a verb with placeholders."""
    lines = re.findall(r"^(?:    )?(perchhw [a-z].*)$", page.read_text(encoding="utf-8"), re.MULTILINE)
    return [line.split("#")[0].strip() for line in lines if " is " not in line]


TWINS = {
    "flying.md": pytest.mark.soak,  # three flights, as docs/flight_day.md flies one
    "doctor.md": pytest.mark.further,  # as that of docs/flight_day.md
    "rehearsal.md": pytest.mark.further,  # tests/rehearsal
}
"""Pages whose commands other tests give in make test."""


@pytest.fixture(scope="module")
def lab() -> Iterator[SimulatedLab]:
    """One for all pages: those whose commands move nothing, then the one that flies."""
    with SimulatedLab("lab", (*FREE_PORTS, *LOCKSTEP, "--seed", "3")) as lab:
        yield lab


@pytest.mark.parametrize(
    "page",
    [
        pytest.param(p, marks=TWINS[p.name]) if p.name in TWINS else p
        for p in sorted(PAGES, key=lambda page: page.name == "flying.md")
        if run_here(p) and BENCH not in console_lines(p) and p.name != "flight_day.md"
    ],
    ids=lambda page: page.name,
)
def test_console_lines_run(
    page: Path,
    lab: SimulatedLab,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    addresses = {DRONE: lab.drones[0], MOCAP: lab.mocap[0], LAB_FILE: f"--lab {lab.ready['lab']}"}
    run_console_lines(page, addresses, capsys)


@pytest.mark.soak  # tests/bench_commands works the same wizard with the same options, killed and resumed
@pytest.mark.parametrize("page", [p for p in PAGES if BENCH in console_lines(p)], ids=lambda page: page.name)
def test_console_lines_run_on_the_bench(
    page: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    with SimulatedLab("bench", ["--drone-port", "0", "--pace", "10"]) as bench:
        addresses = {DRONE: patient_uri(bench.drones[0]), HANDS: bench.ready["bench"]["hands"]}
        run_console_lines(page, addresses, capsys)


def run_console_lines(page: Path, addresses: dict[str, str], capsys: pytest.CaptureFixture[str]) -> None:
    """One after the other, in the working folder."""
    for name, content in files(page).items():
        Path(name).write_text(content, encoding="utf-8")
    for line in console_lines(page):
        if line not in run_here(page):
            continue
        here = line
        for shown, real in addresses.items():
            here = here.replace(shown, real)
        program, *arguments = shlex.split(here)
        assert program == "perchhw", f"{page.name}: teach this test how to run {line!r}"
        capsys.readouterr()
        code, said = run(arguments), capsys.readouterr()
        # A flight that is flown may fail to land (the demo prints how likely that is); nothing else may fail.
        allowed = {0, 1} if "outcome: " in said.out and "aborted" not in said.out else {0}
        assert code in allowed, f"{page.name}: {line}\n{said.out}{said.err}"


def test_the_readme_shows_the_two_commands_first() -> None:
    assert console_lines(REPOSITORY / "README.md")[:2] == ["make demo", "make test"]
    makefile = (REPOSITORY / "Makefile").read_text(encoding="utf-8")
    for command in RUN_BY_CI:
        assert re.search(rf"^{command.split()[1]}:", makefile, re.MULTILINE)


@pytest.mark.parametrize(
    ("page", "synopsis"),
    [(p.name, line) for p in PAGES for line in synopses(p)],
    ids=lambda value: value[:60],
)
def test_synopses_agree_with_the_help(page: str, synopsis: str, capsys: pytest.CaptureFixture[str]) -> None:
    words = synopsis.split()[1:]
    verbs = [word for word in words[:2] if re.fullmatch(r"[a-z]+", word)]
    code = run([*verbs, "--help"])
    if code and len(verbs) == 2:
        code = run([verbs[0], "--help"])
    shown = capsys.readouterr()
    assert code == 0, f"{page}: {synopsis}\n{shown.err}"
    for option in re.findall(r"--[a-z][a-z-]*", synopsis):
        assert option in shown.out or option == "--json", f"{page}: {synopsis} has no {option}"


def test_links_between_pages_lead_somewhere() -> None:
    for page in PAGES:
        for target in re.findall(r"\]\(([^)#]+?)(?:#[^)]*)?\)", page.read_text(encoding="utf-8")):
            if not target.startswith(("http:", "https:")):
                assert (page.parent / target).exists(), f"{page.name} links to {target}"
