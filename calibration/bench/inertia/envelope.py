"""Local amplitude of an oscillation, without a law for its decay."""

import math
from dataclasses import dataclass

import numpy as np

from onboard.arrays import FloatArray

_FEWEST = 8  # samples in a window of one period
_COVERED = 0.7  # of the window that samples must span


@dataclass(frozen=True, slots=True)
class Envelope:
    """Amplitude over time.

    Attributes:
        time: s, (k,), centres of the windows.
        amplitude: rad/s, (k,).
        sigma: rad/s, (k,), standard error of the amplitude from what the window's sine leaves over.
    """

    time: FloatArray
    amplitude: FloatArray
    sigma: FloatArray

    def at(self, time: FloatArray) -> FloatArray:
        """The amplitude at `time` (s), straight between the windows."""
        return np.interp(time, self.time, self.amplitude)


def local_amplitude(time: FloatArray, values: FloatArray, period: float) -> Envelope:
    """Fit a sine of `period` (s) to windows of one period, every half period; thin windows are left out."""
    found = []
    for begin in np.arange(time[0], time[-1] - period + 1e-9, 0.5 * period):
        first, last = np.searchsorted(time, [begin, begin + period])
        t, y = time[first:last], values[first:last]
        if len(t) < _FEWEST or t[-1] - t[0] < _COVERED * period:
            continue
        turn = math.tau / period * t
        columns = np.column_stack([np.cos(turn), np.sin(turn), np.ones_like(t)])
        weights, _, rank, _ = np.linalg.lstsq(columns, y, rcond=None)
        if rank < 3:
            continue
        spread = float(np.sqrt(np.sum((y - columns @ weights) ** 2) / (len(t) - 3)))
        found.append(
            (begin + 0.5 * period, math.hypot(weights[0], weights[1]), spread * math.sqrt(2.0 / len(t)))
        )
    table = np.array(found).reshape(-1, 3)
    return Envelope(table[:, 0], table[:, 1], table[:, 2])
