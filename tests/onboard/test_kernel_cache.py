"""Compiled kernels belong to the source that they were compiled from."""

import os
import re
import subprocess
import sys
import tomllib
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

from onboard.kernel_cache import KEPT, PACKAGES, VARIABLE, compiling, kernel_sources, source_key
from tests.conftest import REPOSITORY
from tests.patience import PATIENCE_S

KERNEL = """\
from onboard.jit import kept
from {package}.between import value

@kept()
def g():
    return value()
"""
BETWEEN = """\
from onboard.jit import for_kernels
from {package} import (  # in the way that long imports are written
    constants as numbers,
)

@for_kernels()
def value():
    return numbers.VALUE
"""
PAIR = """\
from onboard.jit import alone, outlined

@alone
def called(x):
    return 2.0 * x

@outlined
def calling(x):
    return called(x) + 1.0
"""
CALL_AND_COUNT = """\
from onboard.pair import called, calling
print(calling(3.0), *(sum(kernel.stats.cache_misses.values()) for kernel in (called, calling)))
"""
DISPATCHERS = """\
import importlib, inspect, pkgutil
from numba.core.dispatcher import Dispatcher
from onboard.kernel_cache import PACKAGES

for package in PACKAGES:
    for found in pkgutil.walk_packages(importlib.import_module(package).__path__, package + "."):
        if not found.name.endswith("__main__"):
            for value in vars(importlib.import_module(found.name)).values():
                if isinstance(value, Dispatcher):
                    print(inspect.getfile(value.py_func))
"""


@pytest.fixture
def project(tmp_path: Path) -> Path:
    """A tiny project with the real cache rule and our decorators."""
    folder = tmp_path / "project"
    (folder / "onboard").mkdir(parents=True)
    for name in (
        "__init__.py",
        "kernel_cache.py",
        "kernel_file.py",
        "held_folder.py",
        "user_cache.py",
        "jit.py",
    ):
        (folder / "onboard" / name).write_bytes((REPOSITORY / "onboard" / name).read_bytes())
    put_kernel(folder, "onboard")
    return folder


def put_kernel(project: Path, package: str) -> None:
    """A kernel in a package, whose value comes from a file without kernels through one that it calls."""
    folder = project / package.replace(".", "/")
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "kernel.py").write_text(KERNEL.format(package=package))
    (folder / "between.py").write_text(BETWEEN.format(package=package))


def python(project: Path, code: str, **variables: str) -> str:
    """What a new process prints that runs `code` in the project."""
    environment = {k: v for k, v in os.environ.items() if k != "NUMBA_CACHE_DIR"}
    # Two sources of one second and one length have the same compiled module in Python's eyes.
    environment |= {
        "XDG_CACHE_HOME": str(project.parent / "cache"),
        "PYTHONDONTWRITEBYTECODE": "1",
        **variables,
    }
    done = subprocess.run(
        [sys.executable, "-c", code],
        capture_output=True,
        text=True,
        check=True,
        env=environment,
        cwd=project,
    )
    return done.stdout.strip()


def put_value(project: Path, value: int, package: str = "onboard") -> None:
    """The constant that a package's kernel gives."""
    (project / package.replace(".", "/") / "constants.py").write_text(f"VALUE = {value}\n")


def run_with(project: Path, value: int, package: str = "onboard") -> str:
    """Change the constant and let a new process call the kernel."""
    put_value(project, value, package)
    return python(project, f"import {package}.kernel; print({package}.kernel.g())", PYTHONPATH=str(project))


@pytest.mark.further
@pytest.mark.slow
def test_a_change_in_another_file_is_compiled_in(project: Path) -> None:
    for value in (1, 2):
        calls = []
        for package in ("calibration.gap", "sim_backend.bench"):
            put_kernel(project, package)
            put_value(project, value, package)
            calls.append(f"import {package}.kernel; print({package}.kernel.g())")
        assert python(project, "; ".join(calls), PYTHONPATH=str(project)).split() == [str(value)] * 2


@pytest.mark.slow
def test_of_two_processes_one_compiles_and_the_other_waits(project: Path) -> None:
    put_kernel(project, "calibration.gap")
    put_value(project, 1, "calibration.gap")
    code = "from calibration.gap.kernel import g; g(); print(sum(g.stats.cache_misses.values()))"
    with ThreadPoolExecutor(2) as threads:
        processes = [threads.submit(python, project, code, PYTHONPATH=str(project)) for _ in range(2)]
        compiled = [int(process.result()) for process in processes]
    assert sorted(compiled) == [0, 1]


@pytest.mark.slow
def test_a_caller_on_disk_finds_what_it_calls_and_is_compiled_anew_with_it(project: Path) -> None:
    (project / "onboard" / "pair.py").write_text(PAIR)
    runs = [python(project, CALL_AND_COUNT, PYTHONPATH=str(project)) for _ in range(2)]
    for file in (project.parent / "cache").rglob("pair.called-*"):
        file.unlink()
    # Whatever is compiled before it changes the name of its machine code.
    before = "from numba import int64; from onboard.pair import calling; calling.compile((int64,)); "
    runs += [python(project, before + CALL_AND_COUNT, PYTHONPATH=str(project))]
    runs += [python(project, CALL_AND_COUNT, PYTHONPATH=str(project))]
    assert runs == ["7.0 1 1", "7.0 0 0", "7.0 2 2", "7.0 0 0"]


@pytest.mark.further
@pytest.mark.parametrize("suffix", [".nbi", ".nbc"])
def test_a_kernel_whose_file_is_damaged_is_compiled_anew(project: Path, suffix: str) -> None:
    (project / "onboard" / "pair.py").write_text(PAIR)

    def told() -> str:
        return python(project, CALL_AND_COUNT, PYTHONPATH=str(project))

    assert told() == "7.0 1 1"
    (file,) = (project.parent / "cache").rglob(f"pair.calling-*{suffix}")
    whole = file.read_bytes()
    middle = len(whole) // 2
    for damaged in (whole[:middle], whole[:-9] + b"\0" + whole[-8:]):
        file.write_bytes(damaged)
        assert told() == "7.0 0 1"
        assert told() == "7.0 0 0"


@pytest.mark.slow
@pytest.mark.further
def test_a_disk_that_takes_no_kernel_costs_the_time_to_compile_it(project: Path) -> None:
    put_value(project, 1)
    no_room = "import resource, signal; signal.signal(signal.SIGXFSZ, signal.SIG_IGN); "
    no_room += "from onboard.kernel import g; resource.setrlimit(resource.RLIMIT_FSIZE, (64, 64)); print(g())"
    assert python(project, no_room, PYTHONPATH=str(project)) == "1"
    assert run_with(project, 1) == "1"


@pytest.mark.slow
def test_a_cache_that_cannot_be_written_keeps_no_kernel_beside_the_source(project: Path) -> None:
    """There numba would go by the time of the kernel's own file, and not see that another one changes."""
    put_value(project, 1)
    (project.parent / "cache").touch()
    code = "import os, onboard.kernel as k; print(k.g(), os.environ['NUMBA_CACHE_DIR'])"
    value, _, folder = python(project, code, PYTHONPATH=str(project)).partition(" ")
    assert value == "1"
    assert not list(project.rglob("*.nb?"))
    assert not Path(folder).exists()


def test_nobody_waits_for_a_process_that_is_suspended(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(VARIABLE, str(tmp_path))
    code = "import os, signal; from onboard.kernel_cache import compiling\n"
    code += "with compiling('k'): os.kill(os.getpid(), signal.SIGSTOP)"

    def compile_it() -> bool:
        with compiling("k"):
            return True

    with ThreadPoolExecutor(1) as threads, subprocess.Popen([sys.executable, "-c", code]) as holder:
        os.waitpid(holder.pid, os.WUNTRACED)
        waiting = threads.submit(compile_it)
        try:
            assert waiting.result(PATIENCE_S)
        finally:
            holder.kill()


def test_the_packages_are_those_that_are_installed() -> None:
    project = tomllib.loads((REPOSITORY / "pyproject.toml").read_text())
    installed = project["tool"]["setuptools"]["packages"]["find"]["include"]
    assert sorted(PACKAGES) == sorted(pattern.removesuffix("*") for pattern in installed)


@pytest.mark.slow
def test_every_kernel_of_ours_belongs_to_the_key() -> None:
    files = python(REPOSITORY, DISPATCHERS, PYTHONPATH=str(REPOSITORY)).splitlines()
    ours = {Path(file) for file in files if Path(file).is_relative_to(REPOSITORY)}
    assert len(ours) > 50
    assert ours <= set(kernel_sources(REPOSITORY))


def test_decorators_come_through_the_file_that_chooses_the_folder() -> None:
    users = {
        path.relative_to(REPOSITORY).as_posix()
        for package in PACKAGES
        for path in (REPOSITORY / package).rglob("*.py")
        if re.search(r"^\s*(from numba import|import numba)\b", path.read_text(), re.MULTILINE)
    }
    assert users == {"onboard/jit.py"}


def test_what_no_kernel_imports_does_not_change_the_key(project: Path) -> None:
    put_value(project, 1)
    before = source_key(project)
    (project / "onboard" / "page.py").write_text("from onboard.constants import VALUE\n")
    assert source_key(project) == before
    put_value(project, 2)
    assert source_key(project) != before


def test_commands_without_kernels_do_not_look_for_their_source(project: Path) -> None:
    assert python(project, "import onboard, os; print(os.environ.get('NUMBA_CACHE_DIR'))") == "None"


@pytest.mark.further
@pytest.mark.slow
def test_a_note_of_complete_kernels_goes_with_the_source(project: Path) -> None:
    ask = "import onboard.jit; from onboard.kernel_cache import *; print(is_complete('flight'))"
    path = {"PYTHONPATH": str(project)}
    put_value(project, 1)
    assert python(project, ask, **path) == "False"
    python(project, ask.replace("print(is_complete('flight'))", "note_complete('flight')"), **path)
    assert python(project, ask, **path) == "True"
    put_value(project, 2)
    assert python(project, ask, **path) == "False"


@pytest.mark.slow
def test_the_same_source_compiles_once_and_old_kernels_go(project: Path) -> None:
    cache = project.parent / "cache" / "perchhw"
    earlier = [cache / f"kernels-{number}" for number in range(KEPT + 2)]
    for folder in earlier:
        folder.mkdir(parents=True)
        os.utime(folder, (0, 0))
    run_with(project, 1)
    youngest = set(cache.glob("kernels-*"))
    assert len(youngest) == KEPT + 1
    run_with(project, 1)
    assert set(cache.glob("kernels-*")) == youngest
    assert len(youngest - set(earlier)) == 1


def test_the_key_follows_content_and_names(project: Path) -> None:
    before = source_key(project)
    assert source_key(project) == before
    kernel = project / "onboard" / "kernel.py"
    kernel.rename(kernel.with_name("other.py"))
    assert source_key(project) != before


def test_a_source_that_was_read_is_known_by_its_times_until_it_changes(project: Path) -> None:
    code = """\
import onboard.kernel_cache as cache
cache._TICK_S = -1.0
read, cache.source_key = cache.source_key, lambda root: print("read") or read(root)
print(cache._key_of_this_source())
"""

    def told() -> list[str]:
        return python(project, code, PYTHONPATH=str(project)).split()

    put_value(project, 1)
    first = told()
    assert first[0] == "read"
    assert told() == first[1:]
    constants = project / "onboard" / "constants.py"
    before = constants.stat()
    put_value(project, 2)
    os.utime(constants, ns=(before.st_atime_ns, before.st_mtime_ns))  # of the same length and time
    second = told()
    assert second[0] == "read"
    assert second[1] != first[1]
    assert told() == second[1:]
