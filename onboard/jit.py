"""How compiled functions are compiled, onboard and in the physics."""

from numba import njit

kernel = njit(cache=True, nogil=True, error_model="numpy")
"""Decorator of all kernels: cached on disk, free of the interpreter lock, and IEEE division as in C.

A division by zero gives inf or NaN as in numpy; nothing tests for it each time, callers catch it where it
matters.
"""
