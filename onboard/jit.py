"""How compiled functions are compiled, onboard and in the physics."""

from collections.abc import Callable
from typing import ParamSpec, TypeVar

from numba import njit

_P = ParamSpec("_P")
_R = TypeVar("_R")

kernel = njit(cache=True, nogil=True, error_model="numpy", forceinline=True)
"""Decorator of all kernels: cached on disk, free of the interpreter lock, IEEE division as in C, inlined.

A division by zero gives inf or NaN as in numpy; nothing tests for it each time, callers catch it where it
matters. Inlining takes a fifth off a step of physics and a quarter off one with the controller.
"""


def interpreted(function: Callable[_P, _R]) -> Callable[_P, _R]:
    """A kernel as Python runs it, for callers whose first call must not wait for a compiler."""
    python: Callable[_P, _R] = getattr(function, "py_func", function)
    return python
