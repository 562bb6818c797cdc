"""From flights as they were logged to records that can be analysed; rules in ``docs/gap_data.md``."""

from calibration.gap.prepare.flights import prepare_flight, prepare_flights
from calibration.gap.prepare.result import Prepared, Refusal
from calibration.gap.prepare.velocity import differentiate
from calibration.gap.prepare.windows import BEFORE_S, usable_samples, window_starts

__all__ = [
    "BEFORE_S",
    "Prepared",
    "Refusal",
    "differentiate",
    "prepare_flight",
    "prepare_flights",
    "usable_samples",
    "window_starts",
]
