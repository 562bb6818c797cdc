"""Mutants of function bodies, tried in forks of one process that has imported and collected everything.

A fork puts the mutated code in place of the function's, and runs the tests that call the function. What acts
while modules are imported (constants, tables, classes, functions that are called then) is left to
:func:`tests.mutation.trial.run_tests`, which imports anew.
"""

import gc
import sys
from collections import defaultdict
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from types import CodeType, FrameType, FunctionType
from typing import Any, TypeAlias

import pytest

from tests.conftest import REPOSITORY
from tests.mutation.mutant import Mutant
from tests.mutation.targets import Target
from tests.mutation.trial import Send, Watcher, likeliest, pytest_options

Place: TypeAlias = tuple[str, str]
"""Dotted name of a module, and qualified name of a function in it."""


@dataclass(slots=True)
class Collected:
    """Tests that are collected, and ready to be run in forks.

    Attributes:
        items: all of them.
        modules: dotted names of the targets.
        early: their functions that were called before the first test.
        functions: all their functions, each with what decorators have made copies of.
        callers: the tests that call a function; known once they have all been run.
    """

    items: list[pytest.Item]
    modules: set[str]
    early: set[Place]
    functions: dict[Place, list[FunctionType]]
    callers: defaultdict[Place, set[str]]

    def run_all(self, send: Send) -> None:
        """Run all on the code as it is; send ``code``, ``failed`` and ``durations``, ``calls`` by test."""
        watcher = Watcher()
        self.items[0].config.pluginmanager.register(watcher)
        calls: dict[str, list[Place]] = {}
        for item, following in self._with_next(self.items):
            with _noting_calls(self.modules) as called:
                item.config.hook.pytest_runtest_protocol(item=item, nextitem=following)
            calls[item.nodeid] = sorted(called)
        code = 1 if watcher.failed else 0
        send({"code": code, "failed": watcher.failed, "durations": watcher.durations, "calls": calls})

    def can_try(self, mutant: Mutant) -> bool:
        """Whether the mutant is in the body of a function that is called in tests only."""
        place = _place(mutant)
        return place not in self.early and place in self.functions

    def run(self, mutant: Mutant, send: Send, first: Sequence[str], durations: dict[str, float]) -> None:
        """Run the tests that call the mutant's function, with the mutant in its place; send who failed."""
        place = _place(mutant)
        source = mutant.source((REPOSITORY / mutant.file).read_text(encoding="utf-8"))
        code = _code_of(compile(source, mutant.file, "exec", dont_inherit=True), mutant.function)
        for function in self.functions[place]:
            function.__code__ = code
        chosen = [item for item in self.items if item.nodeid in self.callers[place]]
        key = likeliest(first, durations)
        chosen.sort(key=lambda item: key(item.nodeid))
        self.items[0].config.pluginmanager.register(Watcher(send))
        for item, following in self._with_next(chosen):
            item.config.hook.pytest_runtest_protocol(item=item, nextitem=following)
        send({"code": 0, "failed": ""})

    @staticmethod
    def _with_next(items: list[pytest.Item]) -> Iterator[tuple[pytest.Item, pytest.Item | None]]:
        return zip(items, [*items[1:], None], strict=True)


class _Collector:
    """pytest plugin: instead of running the tests that were collected, gives them away."""

    def __init__(self, modules: set[str], use: Callable[[Collected], None]) -> None:
        self._modules = modules
        self._use = use
        self._early: set[Place] = set()

    @pytest.hookimpl(hookwrapper=True)
    def pytest_collection(self) -> Iterator[None]:
        with _noting_calls(self._modules) as self._early:
            yield

    def pytest_runtestloop(self, session: pytest.Session) -> bool:
        functions = _functions(self._modules)
        self._use(Collected(session.items, self._modules, self._early, functions, defaultdict(set)))
        return True


def collect(targets: Sequence[Target], use: Callable[[Collected], None]) -> int:
    """Collect the tests that some targets have in common, and `use` them. pytest's exit code."""
    modules = {target.module for target in targets}
    return int(pytest.main(pytest_options(targets[0].tests), plugins=[Watcher(), _Collector(modules, use)]))


@contextmanager
def _noting_calls(modules: set[str]) -> Iterator[set[Place]]:
    """The functions of these modules that are called within the block."""
    called: set[Place] = set()

    def note(frame: FrameType, event: str, value: Any) -> None:
        module = frame.f_globals.get("__name__")
        if module in modules:
            called.add((str(module), frame.f_code.co_qualname))

    sys.settrace(note)
    try:
        yield called
    finally:
        sys.settrace(None)


def _place(mutant: Mutant) -> Place:
    return mutant.file.removesuffix(".py").replace("/", "."), mutant.function


def _functions(modules: set[str]) -> dict[Place, list[FunctionType]]:
    """All functions of modules, but those that were generated, by their place."""
    found: dict[Place, list[FunctionType]] = {}
    gc.unfreeze()  # what a lab in this process has set aside is not listed otherwise
    for thing in gc.get_objects():
        # Not isinstance: it asks objects of lazy libraries for their class, which some of them warn of.
        if type(thing) is FunctionType and thing.__code__.co_filename != "<string>":
            module = thing.__globals__.get("__name__")
            if module in modules:
                found.setdefault((str(module), thing.__code__.co_qualname), []).append(thing)
    return found


def _code_of(code: CodeType, function: str) -> CodeType:
    """The code of a function of a module or class, within the code of its module."""
    for name in function.split("."):
        code = next(
            constant
            for constant in code.co_consts
            if isinstance(constant, CodeType) and constant.co_name == name
        )
    return code
