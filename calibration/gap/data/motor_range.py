"""Motor commands that are logged in another range than 0 to 65535."""

from typing import NamedTuple

from calibration.flights.flight import Flight, UnusableFlightError
from calibration.gap.data.phases import AIRBORNE_PWM
from calibration.gap.data.samples import Samples
from onboard.battery import FULL_RATIO


class _Range(NamedTuple):
    """A range of motor commands that is in use elsewhere.

    Attributes:
        words: what it is.
        most: its end.
        least: what the largest command of a flight exceeds.
        lowest: what the smallest one that turns a motor exceeds.
    """

    words: str
    most: float
    least: float
    lowest: float = 0.0


_RANGES = (
    _Range("shares of full power (0 to 1)", 1.0, 0.1),
    _Range("percent", 100.0, 10.0),
    _Range("bytes (0 to 255)", 255.0, 100.0),
    _Range("pulse widths (1000 to 2000 us)", 2100.0, 1000.0, lowest=900.0),
    _Range("DShot values (48 to 2047)", 2047.0, 255.0),
    _Range("numbers of 12 bits (0 to 4095)", 4095.0, 2100.0),
)


def check_range(flight: Flight, motors: Samples) -> None:
    """Refuse commands none of which would carry a vehicle.

    Raises:
        UnusableFlightError: none would; the message says what the commands may be instead.
    """
    most = float(motors.values.max())
    if most > AIRBORNE_PWM:
        return
    turning = motors.values[motors.values > 0.0]
    lowest = float(turning.min()) if turning.size else 0.0
    other = next((r.words for r in _RANGES if r.least < most <= r.most and lowest >= r.lowest), None)
    hint = f": they look like {other}; convert them to 0 to {FULL_RATIO:.0f}" if other else ""
    raise UnusableFlightError(
        flight.source,
        f"never flies: the motors hardly run, no command is above {most:.4g} of {FULL_RATIO:.0f}{hint}",
    )
