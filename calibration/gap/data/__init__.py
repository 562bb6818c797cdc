"""From flights as they were logged to records that can be analysed; rules in ``docs/gap_data.md``."""

from calibration.gap.data.prepare import Prepared, Refusal, prepare_flight, prepare_flights
from calibration.gap.data.velocity import differentiate

__all__ = [
    "Prepared",
    "Refusal",
    "differentiate",
    "prepare_flight",
    "prepare_flights",
]
