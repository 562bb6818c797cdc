"""How compiled functions are compiled, onboard and in the physics."""

from numba import njit

kernel = njit(cache=True, nogil=True, error_model="numpy", forceinline=True)
"""Decorator of all kernels: cached on disk, free of the interpreter lock, IEEE division as in C, inlined.

A division by zero gives inf or NaN as in numpy; nothing tests for it each time, callers catch it where it
matters. Inlining takes a fifth off a step of physics and a quarter off one with the controller.
"""
