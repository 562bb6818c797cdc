"""A session: which tests pass on the code as it is, and whether one of them notices each mutant."""

import subprocess
import tempfile
from collections.abc import Sequence
from contextlib import redirect_stderr, redirect_stdout
from io import StringIO
from pathlib import Path
from typing import Any

import pytest

from onboard.firmware import library
from onboard.firmware.compiler import FLAGS, SOURCES, needed_compiler
from onboard.vehicle import load_vehicle
from tests.conftest import REPOSITORY
from tests.firmware.mutation.machine import LandingInC
from tests.firmware.mutation.operators import mutants_of
from tests.mutation.allowed import load_allowed
from tests.mutation.document import document_of
from tests.mutation.mutant import Mutant
from tests.mutation.run import drawn
from tests.mutation.session import Known, MutationError, some_at_a_time
from tests.mutation.store import Store, progress, state_of
from tests.mutation.trial import Send, Trial, Watcher, end, likeliest, pytest_options, start
from tests.onboard.landing import rig

CORE = SOURCES / "core"
FILES = ("landing.c", "estimate.c", "braking.c", "own_attitude.c")
TESTS = (
    "tests/onboard/landing",
    "tests/firmware/test_landing_parity.py",
    "tests/firmware/test_law_parity.py::test_stopping_distance",
)
DEPENDS_ON = ("onboard", "tests/firmware", "tests/onboard/landing", "tests/mutation")
"""Folders whose change makes earlier results void."""
EQUIVALENT = Path(__file__).with_name("equivalent.toml")
CPU_LIMIT = 60.0
"""s of processor time for all the tests."""

_FLAGS = tuple(flag for flag in FLAGS if flag not in ("-Werror", "-O2"))


def _text(file: str) -> str:
    return (REPOSITORY / file).read_text(encoding="utf-8")


class Library:
    """The core with one of its files changed: the others are compiled once.

    Args:
        folder: for objects and libraries.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        for source in (*CORE.glob("*.c"), *(SOURCES / "host").glob("*.c")):
            self._compile(source, folder / f"{source.stem}.o")

    def _compile(self, source: Path, made: Path) -> bool:
        command = [
            needed_compiler(),
            *_FLAGS,
            "-O1",
            "-fPIC",
            f"-I{CORE}",
            "-c",
            str(source),
            "-o",
            str(made),
        ]
        return subprocess.run(command, capture_output=True, check=False).returncode == 0

    def compiled(self, mutant: Mutant | None = None) -> Path | None:
        """The shared library with a mutant in it; None where the compiler refuses the mutant."""
        with tempfile.TemporaryDirectory(dir=self._folder) as scratch:
            folder = Path(scratch)
            objects = {path.name: path for path in self._folder.glob("*.o")}
            if mutant is not None:
                source = folder / Path(mutant.file).name
                source.write_text(mutant.source(_text(mutant.file)), encoding="utf-8")
                objects[f"{source.stem}.o"] = folder / f"{source.stem}.o"
                if not self._compile(source, folder / f"{source.stem}.o"):
                    return None
            made = self._folder / f"{folder.name}.so"
            link = [needed_compiler(), "-shared", *map(str, objects.values()), "-lm", "-o", str(made)]
            subprocess.run(link, check=True)
            return made


class _Reds:
    """pytest plugin: which tests fail, and how long each takes."""

    def __init__(self) -> None:
        self.failed: set[str] = set()
        self.durations: dict[str, float] = {}

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        self.durations[report.nodeid] = self.durations.get(report.nodeid, 0.0) + report.duration
        if report.failed:
            self.failed.add(report.nodeid)


class _Session:
    """pytest plugin: instead of running the tests that were collected, tries mutants in forks."""

    def __init__(self, library: Library, mutants: Sequence[Mutant], jobs: int, store: Store) -> None:
        self._library, self._mutants, self._jobs, self._store = library, mutants, jobs, store
        self.set_aside: list[str] = []

    def pytest_runtestloop(self, session: pytest.Session) -> bool:
        items = session.items
        durations, self.set_aside = self._green(items)
        known = Known(durations, CPU_LIMIT)
        items = [item for item in items if item.nodeid not in self.set_aside]

        def begin(mutant: Mutant, log: int) -> Trial:
            made = self._library.compiled(mutant)
            key = likeliest(known.likely(mutant), durations)
            chosen = sorted(items, key=lambda item: key(item.nodeid))
            return start(lambda send: _notice(made, chosen, send), log, known.cpu_limit)

        left = [mutant for mutant in self._mutants if mutant.key not in self._store.verdicts]
        with progress() as bar:
            trying = bar.add_task(
                "mutants", total=len(self._mutants), completed=len(self._mutants) - len(left)
            )
            for mutant, verdict in some_at_a_time(left, begin, self._jobs, known):
                self._store.keep(mutant, verdict)
                bar.advance(trying)
                bar.refresh()
        return True

    def _green(self, items: Sequence[pytest.Item]) -> tuple[dict[str, float], list[str]]:
        """Durations of the tests on the code as it is, and those that fail there."""
        made = self._library.compiled()
        with tempfile.TemporaryFile() as log:
            trial = start(lambda send: _run_all(made, items, send), log.fileno(), CPU_LIMIT)
            with open(trial.result, "rb", closefd=False) as pipe:
                trial.received = pipe.read()
            result = end(trial)
        return result["durations"], result["failed"]


def _put_in_place(made: Path) -> None:
    """Every test of this process gets the library `made`, and the reference's tests its machine."""
    library.compiled_library = lambda: made
    rig.landing_step = LandingInC(library.core_library(), load_vehicle("crazyflie21-upgraded")).step


def _run(items: Sequence[pytest.Item], plugin: object) -> None:
    items[0].config.pluginmanager.register(plugin)
    for item, following in zip(items, [*items[1:], None], strict=True):
        item.config.hook.pytest_runtest_protocol(item=item, nextitem=following)


def _run_all(made: Path | None, items: Sequence[pytest.Item], send: Send) -> None:
    assert made is not None
    _put_in_place(made)
    reds = _Reds()
    _run(items, reds)
    send({"durations": reds.durations, "failed": sorted(reds.failed)})


def _notice(made: Path | None, items: Sequence[pytest.Item], send: Send) -> None:
    """The first test that fails; a mutant that does not compile is noticed by the compiler."""
    if made is None:
        send({"code": 1, "failed": "the compiler"})
    _put_in_place(made)
    made.unlink()
    _run(items, Watcher(send))
    send({"code": 0, "failed": ""})


def run(sample: int | None, seed: int, jobs: int, folder: Path, out: Path, *, again: bool) -> dict[str, Any]:
    """Try all mutants, or `sample` of them, and return the document that is printed.

    Args:
        sample, seed: how many, and of which draw.
        jobs: mutants tried at a time.
        folder: for objects and libraries.
        out, again: as :class:`~tests.mutation.store.Store` has them.

    Raises:
        MutationError: the tests cannot be collected.
    """
    files = [(CORE / file).relative_to(REPOSITORY).as_posix() for file in FILES]
    every = [mutant for file in files for mutant in mutants_of(file, _text(file))]
    asked = drawn(every, sample, seed)
    state = state_of(DEPENDS_ON, frozenset({".py", ".c", ".h"}))
    store = Store(out, dict.fromkeys(files, state), again=again)
    session = _Session(Library(folder), asked, jobs, store)
    said = StringIO()
    # A line that counts no tests, last in the log of a green run, would be read as a run without tests.
    with redirect_stdout(said), redirect_stderr(said):
        code = pytest.main(pytest_options(TESTS), plugins=[session])
    if code not in (pytest.ExitCode.OK, pytest.ExitCode.NO_TESTS_COLLECTED):
        raise MutationError(f"pytest ended with code {code}:\n{said.getvalue()}")
    document = document_of(every, asked, store.verdicts, load_allowed(EQUIVALENT))
    return {
        "seed": None if sample is None else seed,
        **document,
        "tests_set_aside": len(session.set_aside),
    }
