"""The landing tests compiled, and the same tests interpreted (``NUMBA_DISABLE_JIT=1``)."""

import math
from collections.abc import Callable, Iterator
from types import SimpleNamespace

import numba
import numpy as np
import pytest

import onboard.landing.braking
import onboard.rotation

INTERPRETED = bool(numba.config.DISABLE_JIT)


def _as_in_c(function: Callable[[float], float]) -> Callable[[float], float]:
    """`function` with NaN where Python raises: a drone's arithmetic has no exceptions."""

    def quiet(x: float) -> float:
        try:
            return function(x)
        except (ValueError, OverflowError):
            return math.nan

    return quiet


@pytest.fixture(scope="package", autouse=True)
def arithmetic_of_c() -> Iterator[None]:
    """Interpreted kernels calculate with infinities as compiled ones do."""
    if not INTERPRETED:
        yield
        return
    quiet = SimpleNamespace(**vars(math))
    for name in ("sin", "cos", "sqrt", "exp"):
        setattr(quiet, name, _as_in_c(getattr(math, name)))
    with pytest.MonkeyPatch.context() as patch, np.errstate(all="ignore"):
        for module in (onboard.rotation, onboard.landing.braking):
            patch.setattr(module, "math", quiet)
        yield
