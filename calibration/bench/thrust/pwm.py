"""What a motor command does to a brushed motor: the timer compares 8 bits, so the low byte is lost."""

import numpy as np

from onboard.arrays import FloatArray

STEP = 256
"""A command that is a multiple of it loses nothing."""


def applied_duty(command: FloatArray) -> FloatArray:
    """Share of the supply that a 16-bit `command` (0..65535) gives the motor: (command >> 8) / 256."""
    return np.asarray((np.asarray(command).astype(np.int64) >> 8) / STEP, dtype=np.float64)


def exact_set_points(count: int, lowest: float = 0.1, highest: float = 1.0) -> list[int]:
    """`count` commands between two shares of full scale, each a multiple of 256, evenly spread."""
    steps = np.unique(np.rint(np.linspace(lowest * 255.0, highest * 255.0, count)).astype(int))
    return [int(step) * STEP for step in steps]
