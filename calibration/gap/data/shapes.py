"""The trajectory's shape from the name of a flight, for holding out shapes that no fit saw."""

import re
from collections.abc import Sequence

from calibration.flights.flight import Flight

_NOT_SHAPE = {
    *("slow", "medium", "fast", "speed"),  # how fast
    *("mell", "mellinger", "pid", "indi", "lee", "brescianini"),  # under which controller
}
_REPETITION = re.compile(r"^(rep|run|trial|take|no|seed)?\d*$|^\d{8}t\d{6}z$")


def shapes_of(flights: Sequence[Flight]) -> tuple[str, ...]:
    """One name a flight; flights of one shape share it.

    An approach with a known condition is that condition. Otherwise the name without its time, its repetition
    (``_rep1``, trailing digits), speed and controller words. When nothing but one name is left, every flight
    is a shape of its own.
    """
    shapes = tuple(_shape(flight) for flight in flights)
    if len(set(shapes)) <= 1:
        return tuple(f"{shape}#{i + 1}" for i, shape in enumerate(shapes))
    return shapes


def _shape(flight: Flight) -> str:
    if flight.commanded_speed is not None and flight.commanded_angle_deg is not None:
        return f"approach {flight.commanded_speed:.2f} m/s {flight.commanded_angle_deg:.1f} deg"
    words = [w for w in re.split(r"[_\-\s]+", flight.name.lower()) if w]
    kept = [w for w in words if w not in _NOT_SHAPE and not _REPETITION.match(w)]
    return "_".join(kept).rstrip("0123456789") or flight.name
