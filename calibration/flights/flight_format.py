"""What a format of flight files is: how to tell it and how to load it."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from calibration.flights.flight import Flight
from onboard.csv_file import read_header


@dataclass(frozen=True)
class FlightFormat:
    """One format of flight files; its name is in :data:`calibration.flight_formats.FLIGHT_FORMATS`."""

    detects: Callable[[Path], bool]
    load: Callable[[Path], Flight]


def csv_with(test: Callable[[tuple[str, ...]], bool]) -> Callable[[Path], bool]:
    """Tells a CSV file by its header."""
    return lambda path: path.is_file() and test(read_header(path))
