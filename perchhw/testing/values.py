"""What a test may ask of a lab: numbers are looked at before they reach it."""

import math

from perchhw.errors import FlightStackError

MOST_DRONES = 32


class LabInputError(FlightStackError, ValueError):
    """A value that no lab can have; the message says which ones can be."""


def number(name: str, value: object, lowest: float = -math.inf, highest: float = math.inf) -> float:
    """A finite number within its limits.

    Raises:
        LabInputError: it is none.
    """
    if (
        isinstance(value, bool)
        or not isinstance(value, int | float)
        or not (math.isfinite(value) and lowest <= value <= highest)
    ):
        raise LabInputError(f"{name}: {value!r} is not a number{_limits(lowest, highest)}")
    return float(value)


def whole(name: str, value: object, lowest: int, highest: float = math.inf) -> int:
    """A whole number within its limits.

    Raises:
        LabInputError: it is none.
    """
    if isinstance(value, bool) or not isinstance(value, int) or not lowest <= value <= highest:
        raise LabInputError(f"{name}: {value!r} is not a whole number{_limits(lowest, highest)}")
    return value


def _limits(lowest: float, highest: float) -> str:
    if lowest > -math.inf and highest < math.inf:
        return f" from {lowest:g} to {highest:g}"
    return f" of at least {lowest:g}" if lowest > -math.inf else ""
