"""Which compiled functions Python may call."""

import pytest

from onboard.jit import for_kernels, kernel


@for_kernels()
def twice(x: float) -> float:
    return 2.0 * x


@kernel
def thrice(x: float) -> float:
    return twice(x) + x


def test_a_function_for_kernels_serves_them_and_refuses_python() -> None:
    with pytest.raises(TypeError, match="twice is for kernels"):
        twice(1.5)
    assert thrice(1.5) == 4.5
    with pytest.raises(TypeError, match="twice is for kernels"):  # compiled by now
        twice(1.5)
    assert twice.py_func(1.5) == 3.0  # type: ignore[attr-defined]
