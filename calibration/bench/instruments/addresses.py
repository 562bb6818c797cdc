"""Which scale or supply is opened by which URI. The tables here are all that knows the schemes.

``loadcell:///dev/ttyACM0``, ``mtsics:///dev/ttyUSB0?baud=9600``, ``scpi://...``, ``korad://...``, and
``manual://`` for a person. A bare port, or ``serial://``, is a load cell or a SCPI supply.
"""

from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Self

from calibration.bench.instruments.balance import Balance
from calibration.bench.instruments.errors import InstrumentInputError
from calibration.bench.instruments.kept_supply import KeptSupply
from calibration.bench.instruments.load_cell import LoadCell
from calibration.bench.instruments.manual import ManualScale, ManualSupply, Person
from calibration.bench.instruments.scale import Scale
from calibration.bench.instruments.supply_keeper import KINDS

MANUAL = "manual"
AnySupply = KeptSupply | ManualSupply

SCALES: Mapping[str, Callable[[str], Scale]] = {"loadcell": LoadCell, "mtsics": Balance}
"""Scales with a port, by scheme; the first is what a bare port means."""

SUPPLIES: Mapping[str, Callable[[str], KeptSupply]] = {kind: partial(KeptSupply, kind=kind) for kind in KINDS}
"""Supplies with a port, each in a keeper's hands; the first is what a bare port means."""


@dataclass(frozen=True, slots=True)
class InstrumentAddress:
    """Where an instrument is.

    Attributes:
        scheme: of the tables, or :data:`MANUAL`.
        port: ``serial:///dev/...?baud=N`` or a device path; empty for a person.
    """

    scheme: str
    port: str

    @classmethod
    def parse(cls, uri: str, schemes: Collection[str], what: str) -> Self:
        """The address that `uri` writes.

        Args:
            uri: as above.
            schemes: of the instruments that `what` can be.
            what: "scale", for the message.

        Raises:
            InstrumentInputError: no such scheme, or a person with a port.
        """
        default = next(iter(schemes))
        scheme, mark, port = uri.partition("://")
        if not mark or scheme == "serial":
            return cls(default, uri)
        if scheme == MANUAL and not port:
            return cls(scheme, "")
        if scheme not in schemes:
            known = ", ".join(f"{one}:///dev/ttyUSB0" for one in schemes)
            raise InstrumentInputError(
                f"{uri!r} is no {what}: write {known}, {MANUAL}:// for a person who reads and types, or just "
                f"the port ({default})"
            )
        return cls(scheme, f"serial://{port}")


@dataclass(frozen=True, slots=True)
class ScaleAddress(InstrumentAddress):
    """Where a scale is."""

    @classmethod
    def of(cls, uri: str) -> Self:
        """The address that `uri` writes; errors as for :meth:`InstrumentAddress.parse`."""
        return cls.parse(uri, SCALES, "scale")

    def open(self, person: Person) -> Scale:
        """The open scale, a context manager; errors as its class raises them."""
        return ManualScale(person) if self.scheme == MANUAL else SCALES[self.scheme](self.port)


@dataclass(frozen=True, slots=True)
class SupplyAddress(InstrumentAddress):
    """Where a supply is."""

    @classmethod
    def of(cls, uri: str) -> Self:
        """The address that `uri` writes; errors as for :meth:`InstrumentAddress.parse`."""
        return cls.parse(uri, SUPPLIES, "supply")

    @property
    def can_be_cut(self) -> bool:
        """Whether somebody can switch it off from here when this program dies: no person can be told then."""
        return self.scheme != MANUAL

    def open(self, person: Person) -> AnySupply:
        """The open supply, a context manager; errors as its class raises them."""
        return ManualSupply(person) if self.scheme == MANUAL else SUPPLIES[self.scheme](self.port)
