"""Flights below a ceiling whose height somebody knows."""

import math
from collections.abc import Sequence

import numpy as np

from calibration.gap.data.record import FlightRecord
from onboard.room import CeilingError

_CLEARLY = 0.05
"""m. Heights of a ceiling, and of where motion capture has its origin, are not known better."""
_FOR_S = 0.1
"""A pose that jumps, as where a marker is mistaken, does so for less."""


def under_ceiling(records: Sequence[FlightRecord], ceiling_z: float) -> list[FlightRecord]:
    """The flights below a ceiling at this height (m).

    Raises:
        CeilingError: one of them goes clearly above it.
    """
    for record in records:
        top = _top(record)
        if top > ceiling_z + _CLEARLY:
            raise CeilingError(
                f"{record.name} flies at {top:.2f} m, above the ceiling at {ceiling_z:g} m: give the "
                "ceiling's height in the frame of the flights"
            )
    return [record.under(ceiling_z) for record in records]


def _top(record: FlightRecord) -> float:
    """The height (m) above which a flight is for no longer than a jump of its pose lasts."""
    highest_last = np.sort(record.position[record.flying & record.pose_known, 2])
    beyond = round(_FOR_S / record.dt)
    return float(highest_last[-1 - beyond]) if beyond < highest_last.size else -math.inf
