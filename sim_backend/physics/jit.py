"""How the kernels of the physics are compiled."""

from typing import Any

from onboard.jit import ALONE, APART, INLINED, for_kernels, kept

_ROUNDING: dict[str, Any] = {"fastmath": {"contract", "reassoc", "arcp"}}
"""The compiler may fuse, reorder and take reciprocals: the last bits change, infinities and NaN do not."""

kernel = kept(**INLINED, **_ROUNDING)
"""As :data:`onboard.jit.kernel`, free in its rounding, which takes a quarter off a step in contact."""

inner = for_kernels(**INLINED, **_ROUNDING)
"""As :data:`onboard.jit.inner`, likewise."""

outlined = kept(**APART, **_ROUNDING)
"""Decorator of large functions that few vehicles need: kept apart, so that their callers stay small."""

alone = kept(**ALONE, **_ROUNDING)
"""As :data:`onboard.jit.alone`, likewise."""
