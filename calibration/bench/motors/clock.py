"""The scale of an instrument's clock, from its stamps and the host's monotonic time.

A ceramic resonator (Uno class) is off by up to 0.5 %; the host's crystal by some 50 ppm. What a line needs to
arrive is never negative and sometimes long, so that the quickest arrival in each of many stretches of time
tells the line that both clocks follow.
"""

from dataclasses import dataclass

import numpy as np

from calibration.bench.motors.errors import TachometerError
from calibration.measurement import Estimate
from onboard.arrays import FloatArray

RESONATOR_SIGMA = 0.005 / 3.0**0.5
"""Relative: a resonator of +-0.5 % (rectangular) that nobody compared with another clock."""
HOST_SIGMA = 5e-5
"""Relative: of the host's own clock."""
ENOUGH = 60.0
"""s over which two clocks should be compared."""
_STRETCHES = 30
_FEWEST = 10


@dataclass(frozen=True, slots=True)
class ClockFit:
    """An instrument's clock against the host's.

    Attributes:
        scale: seconds of the host in one second of the instrument.
        span: s over which they were compared.
    """

    scale: Estimate
    span: float


def fit_clock(instrument: FloatArray, host: FloatArray) -> ClockFit:
    """Compare stamps with arrivals.

    Args:
        instrument: (n,) s, stamps in the instrument's time.
        host: (n,) s, host's monotonic time at arrival.

    Raises:
        TachometerError: fewer than ten stamps, or no time between them.
    """
    if instrument.size < _FEWEST or instrument[-1] <= instrument[0]:
        raise TachometerError(f"{instrument.size} stamps cannot tell the scale of a clock: record for 60 s")
    span = float(instrument[-1] - instrument[0])
    late = (host - host[0]) - (instrument - instrument[0])
    coarse = np.polyfit(instrument - instrument[0], late, 1)
    rest = late - np.polyval(coarse, instrument - instrument[0])
    stretches = min(_STRETCHES, instrument.size // 3)
    cell = np.minimum(((instrument - instrument[0]) / span * stretches).astype(int), stretches - 1)
    quickest = np.array(
        [np.flatnonzero(cell == k)[np.argmin(rest[cell == k])] for k in range(stretches) if np.any(cell == k)]
    )
    t, lag = instrument[quickest], late[quickest]
    slope, _ = np.polyfit(t - t.mean(), lag, 1)
    residual = lag - np.polyval(np.polyfit(t - t.mean(), lag, 1), t - t.mean())
    dof = max(t.size - 2, 1)
    variance = float(residual @ residual) / dof / float(np.sum((t - t.mean()) ** 2))
    return ClockFit(Estimate(1.0 + float(slope), "1", float(np.hypot(variance**0.5, HOST_SIGMA)), dof), span)
