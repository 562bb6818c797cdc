"""How the kernels of the physics are compiled."""

from numba import njit

_ROUNDING = {"contract", "reassoc", "arcp"}
"""The compiler may fuse, reorder and take reciprocals: the last bits change, infinities and NaN do not."""

kernel = njit(cache=True, nogil=True, error_model="numpy", forceinline=True, fastmath=_ROUNDING)
"""As :data:`onboard.jit.kernel`, free in its rounding, which takes a quarter off a step in contact."""

outlined = njit(cache=True, nogil=True, error_model="numpy", fastmath=_ROUNDING)
"""Decorator of large functions that few vehicles need: kept apart, so that their callers stay small."""
