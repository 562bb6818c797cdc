"""How much of the time in flight a log lets one use, between what it lost or made up."""

import numpy as np

from calibration.flights.flight import Flight, UnusableFlightError
from calibration.gap.data.record import FlightRecord
from calibration.gap.data.signals import SETTLING, usable

_LEAST_SHARE = 0.1
"""Of the time in flight: below, a verdict would be on moments, and speak of flights."""


def known_share(record: FlightRecord) -> float:
    """Share of the time in flight in which forces and torques can be judged."""
    return float(np.mean((usable(record) & record.inertial_known)[record.flying]))


def check_known(flight: Flight, record: FlightRecord) -> None:
    """Refuse a flight of which hardly anything is known.

    Raises:
        UnusableFlightError: it is such a flight; the message says which signal is missing.
    """
    share = known_share(record)
    if share >= _LEAST_SHARE:
        return
    known = {
        "motor commands": record.motors_known,
        "gyro or accelerometer": record.inertial_known,
        "poses": record.pose_known,
    }
    lost = {what: 1.0 - float(np.mean(rows[record.flying])) for what, rows in known.items()}
    worst = max(lost, key=lambda what: lost[what])
    raise UnusableFlightError(
        flight.source,
        f"only {share:.0%} of the time in flight can be used: {worst} are lost, or lie on straight lines as "
        f"a log makes them up between packets, for {lost[worst]:.0%} of it (and after lost commands another "
        f"{SETTLING:g} s); log what was sent and measured, without interpolation",
    )
