"""What preparing flights gives."""

from dataclasses import dataclass
from pathlib import Path

from calibration.gap.data.record import FlightRecord


@dataclass(frozen=True)
class Refusal:
    """A flight that is not used, and why."""

    file: Path
    reason: str


@dataclass(frozen=True)
class Prepared:
    """Flights that can be analysed.

    Attributes:
        records: usable flights, in the order given.
        refused: flights that are not used, each with the reason.
        limitations: what cannot be concluded from these flights, in words.
    """

    records: tuple[FlightRecord, ...]
    refused: tuple[Refusal, ...]
    limitations: tuple[str, ...]
