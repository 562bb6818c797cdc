"""Names for the types that numbers travel in."""

from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

Vector: TypeAlias = tuple[float, float, float]
"""x, y, z."""
Quaternion: TypeAlias = tuple[float, float, float, float]
"""Scalar-last (x, y, z, w), unit length, body to world."""
FloatArray: TypeAlias = NDArray[np.float64]
BoolArray: TypeAlias = NDArray[np.bool_]
IntArray: TypeAlias = NDArray[np.int64]
