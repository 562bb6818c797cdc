"""Compiled kernels belong to the source that they were compiled from."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from onboard.kernel_cache import KEPT, source_key
from tests.conftest import REPOSITORY

CALLER = (
    "from numba import njit\nfrom onboard.callee import f\n\n@njit(cache=True)\ndef g():\n    return f()\n"
)
CALLEE = "from numba import njit\n\n@njit(cache=True)\ndef f():\n    return {value}\n"


@pytest.fixture
def project(tmp_path: Path) -> Path:
    """A tiny project with the real cache rule and a kernel that calls one of another file."""
    package = tmp_path / "project" / "onboard"
    package.mkdir(parents=True)
    for name in ("__init__.py", "kernel_cache.py"):
        (package / name).write_bytes((REPOSITORY / "onboard" / name).read_bytes())
    (package / "caller.py").write_text(CALLER)
    return tmp_path / "project"


def run_with(project: Path, value: int) -> str:
    """Write the callee and let a new process call the caller."""
    callee = project / "onboard" / "callee.py"
    callee.write_text(CALLEE.format(value=value))
    environment = {k: v for k, v in os.environ.items() if k != "NUMBA_CACHE_DIR"}
    environment |= {"XDG_CACHE_HOME": str(project.parent / "cache")}
    done = subprocess.run(
        [sys.executable, "-c", "import onboard.caller; print(onboard.caller.g())"],
        capture_output=True,
        text=True,
        check=True,
        env=environment,
        cwd=project,
    )
    return done.stdout.strip()


def test_a_change_in_another_file_is_compiled_in(project: Path) -> None:
    assert [run_with(project, value) for value in (1, 2, 1)] == ["1", "2", "1"]


def test_the_same_source_compiles_once_and_old_kernels_go(project: Path) -> None:
    for value in range(KEPT + 3):
        run_with(project, value)
        run_with(project, value)
    folders = list((project.parent / "cache" / "perchhw").glob("kernels-*"))
    assert len(folders) == KEPT + 1


def test_the_key_follows_content_and_names(project: Path) -> None:
    before = source_key(project)
    assert source_key(project) == before
    caller = project / "onboard" / "caller.py"
    caller.rename(caller.with_name("other.py"))
    assert source_key(project) != before
