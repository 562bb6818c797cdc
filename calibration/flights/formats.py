"""Open flight files of any known format."""

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from calibration.flight_formats import FLIGHT_FORMATS
from calibration.flights.flight import Flight, FlightFileError, UnusableFlightError
from calibration.flights.flight_format import FlightFormat
from onboard.by_name import imported
from onboard.csv_file import read_header
from onboard.errors import InputError


@dataclass(frozen=True)
class UnusableFlight:
    """A file that is broken or holds no usable flight, and why."""

    file: Path
    reason: str


FORMATS: dict[str, FlightFormat] = {name: imported(place) for name, place in FLIGHT_FORMATS.items()}
"""Known formats by name, in the order in which they are tried."""


_TABLES = (".csv", ".csv.gz")

_OTHER_SIGNS = {";": "semicolons", "\t": "tabs"}
"""What spreadsheets of some countries write between columns."""


def open_flight(path: str | Path, format: str = "auto") -> Flight:
    """Read one flight.

    Args:
        path: a file, or a run folder.
        format: a name in :data:`FORMATS`, or ``auto`` to tell it from the content.

    Raises:
        FlightFileError: missing, not readable, of no known format, or broken (names row and column).
        UnusableFlightError: readable, but no usable flight (names the reason).
        RunFolderError: a broken run folder.
    """
    path = Path(path)
    try:
        if not path.exists():
            raise FlightFileError(f"{path}: no such file or folder")
        return _format_of(path, format).load(path)
    except OSError as error:
        raise FlightFileError(f"{path}: cannot be read ({error.strerror})") from error


def open_flights(
    paths: Iterable[str | Path], format: str = "auto"
) -> tuple[list[Flight], list[UnusableFlight]]:
    """Read many flights: the usable ones, and the files that hold none, each with its reason.

    Raises:
        FlightFileError: there is no such format.
    """
    if format != "auto":
        _known(format)
    flights, unusable = [], []
    for path in paths:
        try:
            flights.append(open_flight(path, format))
        except UnusableFlightError as error:
            unusable.append(UnusableFlight(error.source, error.reason))
        except InputError as error:  # broken: a person has to see where
            unusable.append(UnusableFlight(Path(path), str(error)))
    return flights, unusable


def flight_files(paths: Iterable[str | Path]) -> list[Path]:
    """Files and run folders to open: `paths`, with each other folder replaced by the flights in it, sorted.

    Folders within a folder are looked into, so that a campaign's folder stands for its attempts.

    Raises:
        FlightFileError: a path does not exist, or a folder holds no flight of a known format.
    """
    found: list[Path] = []
    for path in map(Path, paths):
        if not path.exists():
            raise FlightFileError(f"{path}: no such file or folder")
        if path.is_file() or _detected(path) is not None:
            found.append(path)
            continue
        inside = _flights_in(path)
        if not inside:
            tables = (entry for entry in sorted(path.iterdir()) if entry.name.endswith(_TABLES))
            hint = next((f": {table.name} {why}" for table in tables if (why := _separated(table))), "")
            raise FlightFileError(f"{path}: no flight of a known format in this folder{hint}")
        found += inside
    return found


def _flights_in(folder: Path) -> list[Path]:
    """Flights in a folder, and tables beside them that are none: opening these says what they lack."""
    found: list[Path] = []
    odd: list[Path] = []
    for entry in sorted(folder.iterdir()):
        if _detected(entry) is not None:
            found.append(entry)
        elif entry.is_dir():
            found += _flights_in(entry)
        elif entry.name.endswith(_TABLES):
            odd.append(entry)
    return sorted([*found, *odd]) if any(one.parent == folder and one.is_file() for one in found) else found


def _separated(path: Path) -> str:
    """That the columns of a table are separated by something else than commas; empty where they are not."""
    header = read_header(path) if path.is_file() else ()
    for sign, words in _OTHER_SIGNS.items():
        if len(header) == 1 and sign in header[0]:
            return f"has columns separated by {words}: write it with commas, and numbers with a point"
    return ""


def _detected(path: Path) -> FlightFormat | None:
    return next((f for f in FORMATS.values() if f.detects(path)), None)


def _format_of(path: Path, name: str) -> FlightFormat:
    if name == "auto":
        found = _detected(path)
        if found is None:
            if why := _separated(path):
                raise FlightFileError(f"{path}: {why}")
            raise FlightFileError(
                f"{path}: of no known flight format; known are {', '.join(FORMATS)} "
                "(name one with --format for a clearer error)"
            )
        return found
    return _known(name)


def _known(name: str) -> FlightFormat:
    if name not in FORMATS:
        raise FlightFileError(f"unknown flight format {name!r}; known are auto, {', '.join(FORMATS)}")
    return FORMATS[name]
