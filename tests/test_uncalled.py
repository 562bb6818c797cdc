"""The ratchet of ``scripts/uncalled.py`` on a small project: what counts as a call, and what does not."""

import subprocess
import sys
from pathlib import Path

import pytest

from tests.conftest import REPOSITORY

FILES = {
    "pyproject.toml": """
[project]
scripts = { perchhw = "perchhw.main:run" }
[project.entry-points.pytest11]
plugin = "perchhw.plugin"
""",
    "README.md": "    from onboard import paged\n    paged()\n",
    "onboard/__init__.py": "from onboard.parts import called, paged, tested\n",
    "onboard/parts.py": """
LIMIT = 3
def called(): return LIMIT
def paged(): return alone()
def tested(): ...
def alone(): ...
def by_string(): ...
def _private(): ...
""",
    "perchhw/__init__.py": "",
    "perchhw/plugin.py": "def fixture(): ...\n",
    "perchhw/main.py": """
import importlib
from onboard import called, tested
@app.command()
def verb(): importlib.import_module("onboard.parts").by_string()
app = object()
def run(tested=0): return called(), app
""",
    "tests/test_it.py": "import onboard\nonboard.tested()\n",
}


def complaints(root: Path, *allowed: str) -> list[str]:
    """What the script says of the project in `root` with these names on its list."""
    for name in ("uncalled.py", "reach.py"):
        (root / "scripts").mkdir(exist_ok=True)
        (root / "scripts" / name).write_text((REPOSITORY / "scripts" / name).read_text())
    (root / "scripts" / "uncalled_allowed.txt").write_text("\n".join(["# why", *allowed]))
    done = subprocess.run(
        [sys.executable, root / "scripts" / "uncalled.py"], capture_output=True, text=True, check=False
    )
    assert done.stderr == ""
    assert done.returncode == bool(done.stdout)
    return done.stdout.splitlines()


@pytest.fixture
def project(tmp_path: Path) -> Path:
    for name, text in FILES.items():
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text(text)
    return tmp_path


UNCALLED = ("onboard.parts:paged", "onboard.parts:alone", "onboard.parts:tested")


def test_what_pages_and_tests_alone_use_is_uncalled(project: Path) -> None:
    said = complaints(project)
    assert [line.partition(": ")[2].partition(":")[0] for line in said] == [
        "alone is used by docs alone",
        "paged is used by docs alone",
        "tested is used by tests alone",
    ]
    assert said[0].startswith("onboard/parts.py:6: ")


def test_the_list_holds_no_more_than_is_uncalled(project: Path) -> None:
    assert complaints(project, *UNCALLED) == []
    (line,) = complaints(project, *UNCALLED, "onboard.parts:called  # it was once")
    assert "onboard.parts:called is called by now" in line
    (line,) = complaints(project, *UNCALLED, "onboard.parts:gone")
    assert "onboard.parts:gone is called by now, or gone" in line
