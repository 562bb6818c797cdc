"""Which scale and which supply has which scheme: names alone, for the help of a command has to be quick.

Addresses are read and opened by :mod:`calibration.bench.instruments.addresses`.
"""

from collections.abc import Iterable
from dataclasses import dataclass

MANUAL = "manual"
"""Of a person, who has no port."""


@dataclass(frozen=True, slots=True)
class InstrumentScheme:
    """One kind of instrument with a port.

    Attributes:
        opener: ``module.Class`` that takes the port, imported when one is opened.
        example: a right address, for help and messages.
        what: it stands for, with its article.
        bare_port: whether it is what a port without a scheme means; of one in a table.
    """

    opener: str
    example: str
    what: str
    bare_port: bool = False


SCALES: dict[str, InstrumentScheme] = {
    "loadcell": InstrumentScheme(
        "calibration.bench.instruments.load_cell.LoadCell",
        "loadcell:///dev/ttyACM0",
        "a load cell",
        bare_port=True,
    ),
    "mtsics": InstrumentScheme(
        "calibration.bench.instruments.balance.Balance", "mtsics:///dev/ttyUSB0", "a balance"
    ),
}
"""Scales by scheme."""

SUPPLIES: dict[str, InstrumentScheme] = {
    "scpi": InstrumentScheme(
        "calibration.bench.instruments.supply.ScpiSupply",
        "scpi:///dev/ttyUSB0",
        "a supply with SCPI",
        bare_port=True,
    ),
    "korad": InstrumentScheme(
        "calibration.bench.instruments.supply.KoradSupply", "korad:///dev/ttyACM0", "a Korad"
    ),
}
"""Supplies by scheme, each held by a keeper of its own."""


def in_words(schemes: Iterable[InstrumentScheme]) -> str:
    """Addresses of all `schemes`, and what they stand for."""
    return ", ".join(
        f"{one.example} for {one.what}{' (or just the port)' if one.bare_port else ''}" for one in schemes
    )
