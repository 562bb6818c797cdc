"""Which scale or supply is opened by which URI, such as ``mtsics:///dev/ttyUSB0?baud=9600``.

The schemes are those of :mod:`calibration.bench.instruments.schemes`, and ``manual://`` for a person. A bare
port, or ``serial://``, is what is marked so there.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Self

from calibration.bench.instruments.errors import InstrumentInputError
from calibration.bench.instruments.kept_supply import KeptSupply
from calibration.bench.instruments.manual import ManualScale, ManualSupply, Person
from calibration.bench.instruments.scale import Scale
from calibration.bench.instruments.schemes import MANUAL, SCALES, SUPPLIES, InstrumentScheme, in_words
from onboard.by_name import imported

AnySupply = KeptSupply | ManualSupply


@dataclass(frozen=True, slots=True)
class InstrumentAddress:
    """Where an instrument is.

    Attributes:
        scheme: of a table, or :data:`MANUAL`.
        port: ``serial:///dev/...?baud=N`` or a device path; empty for a person.
    """

    scheme: str
    port: str

    @classmethod
    def parse(cls, uri: str, schemes: Mapping[str, InstrumentScheme], what: str) -> Self:
        """The address that `uri` writes.

        Args:
            uri: as above.
            schemes: of the instruments that `what` can be.
            what: "scale", for the message.

        Raises:
            InstrumentInputError: no such scheme, or a person with a port.
        """
        scheme, mark, port = uri.partition("://")
        if not mark or scheme == "serial":
            return cls(next(name for name, one in schemes.items() if one.bare_port), uri)
        if scheme == MANUAL and not port:
            return cls(scheme, "")
        if scheme not in schemes:
            raise InstrumentInputError(
                f"{uri!r} is no {what}: write {in_words(schemes.values())}, or {MANUAL}:// for a person who "
                "reads and types"
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
        if self.scheme == MANUAL:
            return ManualScale(person)
        opener: Callable[[str], Scale] = imported(SCALES[self.scheme].opener)
        return opener(self.port)


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
        return ManualSupply(person) if self.scheme == MANUAL else KeptSupply(self.port, self.scheme)
