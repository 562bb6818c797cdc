"""From flights as they were logged to records that can be analysed: notes/rules in ``docs/gap_data.md``."""

from calibration.gap.prepare.flights import prepare_flight, prepare_flights
from calibration.gap.prepare.result import Prepared, Refusal

__all__ = ["Prepared", "Refusal", "prepare_flight", "prepare_flights"]
