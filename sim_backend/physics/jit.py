"""How the kernels of the physics are compiled."""

from numba import njit

kernel = njit(cache=True, nogil=True, error_model="numpy")
"""Decorator of all kernels: cached on disk, free of the interpreter lock, and IEEE division.

A division by zero gives inf or NaN as in numpy, which the rollouts report; nothing tests for it each time.
"""
