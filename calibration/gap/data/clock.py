"""Time columns that are no time."""

import numpy as np

from calibration.flights.flight import Flight, UnusableFlightError
from calibration.gap.data.samples import Samples

_LONGEST_BREAK_S = 60.0
_STANDING_SHARE = 0.6


def check_clock(flight: Flight, pose: Samples) -> None:
    """Refuse a flight whose clock stands still or jumps.

    Raises:
        UnusableFlightError: it does.
    """
    rows = int(np.count_nonzero(flight.valid["x"]))
    if pose.t.size < (1.0 - _STANDING_SHARE) * rows:
        raise UnusableFlightError(
            flight.source,
            f"broken clock: {rows - pose.t.size} of {rows} poses have the time of the one before",
        )
    steps = np.diff(pose.t)
    widest = int(np.argmax(steps))
    if steps[widest] > _LONGEST_BREAK_S:
        raise UnusableFlightError(
            flight.source, f"broken clock: time jumps by {steps[widest]:.1f} s at {pose.t[widest]:.3f} s"
        )
