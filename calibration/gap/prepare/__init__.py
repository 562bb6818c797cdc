"""From flights as they were logged to records that can be analysed; rules in ``docs/gap_data.md``."""

from calibration.gap.prepare.flights import prepare_flight, prepare_flights
from calibration.gap.prepare.result import Prepared, Refusal
from calibration.gap.prepare.velocity import differentiate

__all__ = [
    "Prepared",
    "Refusal",
    "differentiate",
    "prepare_flight",
    "prepare_flights",
]
