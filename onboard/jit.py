"""How compiled functions are compiled, onboard and in the physics.

Numba compiles a function once for each signature: the first start pays for every function, every signature,
and every copy on disk. A plain integer in a call, written there or a constant of the module, makes a
signature of its own (``Literal[int](2)``); a numpy integer does not.

All of ours get numba's decorator from here, so that their kernels are kept where :mod:`onboard.kernel_cache`
says.
"""

from collections.abc import Callable
from importlib import import_module
from typing import Any, NamedTuple, ParamSpec, TypeVar

from llvmlite.binding import parse_assembly
from numba import njit
from numba.core.compiler_lock import global_compiler_lock
from numba.core.runtime.nrt import rtsys

from onboard.kernel_cache import compiling, use_cache_of_this_source
from onboard.kernel_file import keep_in_whole_files

__all__ = [
    "ALONE",
    "APART",
    "INLINED",
    "alone",
    "for_kernels",
    "inner",
    "interpreted",
    "kept",
    "kernel",
    "outlined",
]

use_cache_of_this_source()

_P = ParamSpec("_P")
_R = TypeVar("_R")

APART: dict[str, Any] = {"nogil": True, "error_model": "numpy"}
"""Free of the interpreter lock, and IEEE division as in C.

A division by zero gives inf or NaN as in numpy; nothing tests for it each time, callers catch it where it
matters.
"""

_NOT_FROM_C: dict[str, Any] = {"no_cfunc_wrapper": True}
_NOT_FROM_PYTHON: dict[str, Any] = {"no_cpython_wrapper": True}

ALONE: dict[str, Any] = APART | {"alone": True}
"""A function of its own in its callers' machine code too: a call takes some nanoseconds."""

INLINED: dict[str, Any] = APART | {"forceinline": True}
"""Inlined besides: takes a fifth off a step of physics and a quarter off one with the controller."""


class _ReplacedError(Exception):
    """A kernel on disk calls machine code that has been compiled anew since."""


class _Callee(NamedTuple):
    """Puts a kernel into the memory of a process that loads one of its callers from disk.

    Attributes:
        module, name: of the kernel.
        arguments: numba types.
        symbol: that its callers were compiled to call.
    """

    module: str
    name: str
    arguments: tuple[Any, ...]
    symbol: str

    def __call__(self) -> None:
        """Load it, or compile it.

        Raises:
            _ReplacedError: it has another symbol now.
        """
        dispatcher = getattr(import_module(self.module), self.name)
        dispatcher.compile(self.arguments)
        if dispatcher.overloads[self.arguments].fndesc.llvm_func_name != self.symbol:
            raise _ReplacedError(self.symbol)


def _stand_alone(dispatcher: Any, arguments: tuple[Any, ...]) -> None:
    """From now on callers of a compiled kernel call its machine code, instead of compiling a copy of it.

    Numba links nothing then, and has the kernel brought into memory before a caller is loaded from disk.
    """
    compiled = dispatcher.overloads[arguments]
    library, function = compiled.library, dispatcher.py_func
    symbol = compiled.fndesc.llvm_func_name
    library._shared_module = parse_assembly("")
    library._reload_init = {_Callee(function.__module__, function.__name__, arguments, symbol)}


def kept(*, alone: bool = False, **options: Any) -> Callable[[Callable[_P, _R]], Callable[_P, _R]]:
    """Decorator of functions that are compiled with numba's `options` and kept on disk, without an entry for
    C, which nobody calls. What stands `alone` is compiled once, other functions once more within each caller.

    Of several processes that need one at the same time, one compiles it and the others wait for it. One that
    finds it on disk loads it without all that numba knows for compiling, whose import takes a quarter of the
    start of a program that flies.
    """

    def decorate(function: Callable[_P, _R]) -> Callable[_P, _R]:
        dispatcher = njit(cache=True, **_NOT_FROM_C, **options)(function)
        if dispatcher is function:  # numba is told not to compile
            return function
        compile_here = dispatcher.compile

        def compile_once(signature: Any) -> Any:
            # numba's own lock first: it is held where a kernel compiles another.
            with global_compiler_lock, compiling(f"{function.__module__}.{function.__qualname__}"):
                known = set(dispatcher.overloads)
                entry = compile_here(signature)
                if alone:
                    for arguments in dispatcher.overloads.keys() - known:
                        _stand_alone(dispatcher, arguments)
                return entry

        cache = dispatcher._cache  # of numba's class, which has no public way to it
        keep_in_whole_files(cache)

        def load(signature: Any, target: Any) -> Any:
            # As numba's own, but that makes the whole of `target` ready first; a kernel needs its memory's.
            rtsys.initialize(target)
            try:
                found = cache._load_overload(signature, target)
            except _ReplacedError:
                return None
            if found is not None:  # its callers need what it needs, which numba forgets
                found.library._reload_init.update(found.reload_init)
            return found

        dispatcher.compile, cache.load_overload = compile_once, load
        kept_function: Callable[_P, _R] = dispatcher
        return kept_function

    return decorate


def for_kernels(**options: Any) -> Callable[[Callable[_P, _R]], Callable[_P, _R]]:
    """Decorator of functions that are compiled with numba's `options` where a kernel calls them.

    They have no way in from Python, which takes the compiler a fifth of its time: called from there they
    raise TypeError.
    """

    def decorate(function: Callable[_P, _R]) -> Callable[_P, _R]:
        dispatcher = njit(**_NOT_FROM_PYTHON, **_NOT_FROM_C, **options)(function)
        if dispatcher is function:  # numba is told not to compile
            return function

        def note(compiled: Any) -> None:
            # As numba's own, but where a call from Python looks there is nothing: it would go astray.
            dispatcher.overloads[tuple(compiled.signature.args)] = compiled

        def refuse(*_: object, **__: object) -> None:
            name = f"{function.__module__}.{function.__qualname__}"
            raise TypeError(f"{name} is for kernels: Python has its py_func")

        dispatcher.add_overload, dispatcher._compile_for_args = note, refuse
        called: Callable[_P, _R] = dispatcher
        return called

    return decorate


kernel = kept(**INLINED)
"""Decorator of kernels that Python calls, or that several others share: kept on disk."""

outlined = kept(**APART)
"""Decorator of large functions, and of those that Python calls alone: what is inlined is compiled once more
for each caller, and Python's way in is one."""

alone = kept(**ALONE)
"""Decorator of large functions that take a microsecond or more: compiled once, however many call them."""

inner = for_kernels(**INLINED)
"""Decorator of kernels that only kernels call: on disk as a part of these, but not by themselves."""


def interpreted(function: Callable[_P, _R]) -> Callable[_P, _R]:
    """A kernel as Python runs it, for callers whose first call must not wait for a compiler."""
    python: Callable[_P, _R] = getattr(function, "py_func", function)
    return python
