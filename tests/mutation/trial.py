"""One run of tests in a process of its own, with a mutant in place of its module. POSIX only: it forks.

The mutant is compiled from memory by an import hook; no file is changed, and none is left behind.
"""

import gc
import importlib
import importlib.abc
import importlib.machinery
import importlib.util
import json
import os
import resource
import signal
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from math import inf
from pathlib import Path
from types import CodeType, ModuleType
from typing import Any, NoReturn, TypeAlias

import pytest
from hypothesis import Phase, settings

from tests.conftest import REPOSITORY
from tests.mutation.mutant import Mutant, mutants_of
from tests.mutation.targets import LEFT_OUT, Target

PLUGINS = ("pytest_timeout", "no:unraisableexception", "no:threadexception", "no:cacheprovider")
"""All that the tests need; others are not loaded, to start and to end sooner."""


Send: TypeAlias = Callable[[Any], NoReturn]
"""Sends a result, and ends the process."""


class _Finder(importlib.abc.MetaPathFinder):
    """Finds one module, with other source than its file has."""

    def __init__(self, target: Target, source: str) -> None:
        self._target = target
        self._source = source

    def find_spec(
        self, fullname: str, path: Sequence[str] | None, target: ModuleType | None = None
    ) -> importlib.machinery.ModuleSpec | None:
        if fullname != self._target.module:
            return None
        loader = _Loader(fullname, str(REPOSITORY / self._target.file), self._source)
        return importlib.util.spec_from_loader(fullname, loader)


class _Loader(importlib.machinery.SourceFileLoader):
    def __init__(self, fullname: str, path: str, source: str) -> None:
        super().__init__(fullname, path)
        self._source = source

    def get_code(self, fullname: str) -> CodeType:
        return compile(self._source, self.path, "exec", dont_inherit=True)


class Watcher:
    """pytest plugin: the same examples each time, how long each test took, and who failed first."""

    def __init__(self, notice: Send | None = None) -> None:
        self.failed = ""
        self.durations: dict[str, float] = {}
        self._notice = notice

    def pytest_collection(self) -> None:
        settings.register_profile(
            "mutation",
            parent=settings.get_profile("perchhw"),
            derandomize=True,
            database=None,
            phases=[Phase.explicit, Phase.generate],
        )
        settings.load_profile("mutation")

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        self.durations[report.nodeid] = self.durations.get(report.nodeid, 0.0) + report.duration
        if report.failed and not self.failed:
            self.failed = report.nodeid
            if self._notice is not None:
                self._notice({"code": 1, "failed": report.nodeid})


class _Order:
    """pytest plugin: the likeliest tests first, then the quick ones."""

    def __init__(self, first: Sequence[str], durations: dict[str, float]) -> None:
        self._key = likeliest(first, durations)

    def pytest_collection_modifyitems(self, items: list[pytest.Item]) -> None:
        items.sort(key=lambda item: self._key(item.nodeid))


def likeliest(first: Sequence[str], durations: dict[str, float]) -> Callable[[str], tuple[bool, float]]:
    """The key that puts the tests `first` first, and quick ones (`durations`, s) before slow ones."""
    return lambda test: (test not in first, round(durations.get(test, 0.0), 2))


@dataclass(slots=True)
class Trial:
    """A process at work. `result` reads as JSON once it has ended; nothing when it was killed."""

    pid: int
    result: int
    deadline: float
    received: bytes = field(default=b"")

    def waits_in_vain(self) -> bool:
        """Whether its time is over, and it is not the processor that it waits for."""
        if time.monotonic() <= self.deadline:
            return False
        state = Path(f"/proc/{self.pid}/stat").read_text(encoding="utf-8").rpartition(") ")[2][0]
        return state != "R"


def _send(writer: int, result: Any) -> NoReturn:
    """Write what JSON can say, and end this process without the ceremony of one that was not forked."""
    sys.stdout.flush()
    with os.fdopen(writer, "wb") as pipe:
        pipe.write(json.dumps(result).encode())
    os._exit(0)


def start(work: Callable[[Send], None], log: int, cpu_limit: float) -> Trial:
    """Fork, and do `work` there.

    Args:
        work: is given what sends its result and ends its process.
        log: file descriptor of what the process prints.
        cpu_limit: s of processor time after which the process is killed; one that then still waits, but for
            a processor that others have, is after twenty times as long.
    """
    reader, writer = os.pipe()
    pid = os.fork()
    if pid == 0:
        try:
            os.close(reader)
            os.dup2(log, 1)
            os.dup2(log, 2)
            seconds = int(cpu_limit) + 1
            resource.setrlimit(resource.RLIMIT_CPU, (seconds, seconds + 1))
            gc.disable()
            work(lambda result: _send(writer, result))
        finally:
            os._exit(1)
    os.close(writer)
    return Trial(pid, reader, time.monotonic() + 20.0 * cpu_limit)


def end(trial: Trial) -> Any:
    """What the process sent, or None when it was killed. Called when its pipe is closed or its time over."""
    os.kill(trial.pid, signal.SIGKILL)
    os.close(trial.result)
    os.waitpid(trial.pid, 0)
    return json.loads(trial.received) if trial.received else None


def find_mutants(targets: Sequence[Target], send: Send) -> None:
    """Send the mutants of all targets as dictionaries. For a process of its own: it imports the targets."""
    found = []
    for target in targets:
        names = vars(importlib.import_module(target.module))
        source = (REPOSITORY / target.file).read_text(encoding="utf-8")
        found += mutants_of(target.file, source, names)
    send([{name: getattr(mutant, name) for name in Mutant.__slots__} for mutant in found])


def pytest_options(tests: Sequence[str]) -> list[str]:
    """The command line for files or folders of tests, below the repository."""
    options = ["-x", "-q", "-s", "--assert=plain", "--timeout=0", f"--rootdir={REPOSITORY}"]
    for plugin in PLUGINS:
        options += ["-p", plugin]
    for test in LEFT_OUT:
        options += ["--deselect", test] if "::" in test else ["--ignore", str(REPOSITORY / test)]
    return [*options, *(str(REPOSITORY / test) for test in tests)]


def run_tests(
    target: Target, mutant: Mutant, send: Send, first: Sequence[str], durations: dict[str, float]
) -> None:
    """Import a mutant in place of its module, and send ``code`` (of pytest) and ``failed`` (a test).

    Args:
        target: the module and its tests.
        mutant: the change, noticed by the first test that fails.
        send: what sends a result and ends the process.
        first: tests to begin with.
        durations: of all tests, s. Files are run one by one, those of `first` and quick ones before others.
    """
    source = mutant.source((REPOSITORY / target.file).read_text(encoding="utf-8"))
    sys.meta_path.insert(0, _Finder(target, source))
    files: dict[str, float] = {}
    for test, duration in durations.items():
        file = test.partition("::")[0]
        files[file] = files.get(file, 0.0) + duration
    likely = [test.partition("::")[0] for test in reversed(first)]
    for file in sorted(files, key=lambda file: (likely.index(file) if file in likely else inf, files[file])):
        plugins = [Watcher(send), _Order(first, durations)]
        code = int(pytest.main(pytest_options([file]), plugins=plugins))
        if code != 0:
            send({"code": code, "failed": ""})
    send({"code": 0, "failed": ""})
