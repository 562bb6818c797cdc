"""From flights as they were logged to records that can be analysed; rules in ``docs/gap_data.md``."""

from calibration.gap.data.kinematics import differentiate
from calibration.gap.data.prepare import PreparedFlights, prepare_flights

__all__ = ["PreparedFlights", "differentiate", "prepare_flights"]
