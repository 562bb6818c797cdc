"""The drone's tables of contents, typed: which parameters and log variables exist, and how they look on the
wire. The codes of types are the firmware's (``param.h``, ``log.h``)."""

import struct
from dataclasses import dataclass

from onboard.link.errors import LinkError, LinkInputError, NoSuchVariable
from onboard.link.table_cache import Rows

_TYPE, _READ_ONLY = 0x0F, 0x40
_PARAMETER_FORMATS = {
    0x00: "<b",
    0x01: "<h",
    0x02: "<i",
    0x03: "<q",
    0x05: "<e",
    0x06: "<f",
    0x07: "<d",
    0x08: "<B",
    0x09: "<H",
    0x0A: "<I",
    0x0B: "<Q",
}
_LOG_FORMATS = {1: "<B", 2: "<H", 3: "<I", 4: "<b", 5: "<h", 6: "<i", 7: "<f", 8: "<e"}


@dataclass(frozen=True, slots=True)
class DroneVariable:
    """One parameter or log variable.

    Attributes:
        name: ``group.name``.
        ident: id on the wire; changes between firmware builds.
        type_code: the log port's code of the type (logs only, else 0).
        format: ``struct`` format, little endian.
        read_only: the drone accepts no writes (parameters only).
    """

    name: str
    ident: int
    type_code: int
    format: str
    read_only: bool = False

    @property
    def size(self) -> int:
        """Bytes on the wire."""
        return struct.calcsize(self.format)

    def unpack(self, data: bytes) -> float | int:
        """The value in ``data``.

        Raises:
            struct.error: ``data`` has not the size of this type.
        """
        value: float | int = struct.unpack(self.format, data)[0]
        return value

    def pack(self, value: float) -> bytes:
        """The bytes of ``value``.

        Raises:
            LinkInputError: the value does not fit the type.
        """
        if self.format[-1] in "efd":
            exact: float | int = float(value)
        else:
            exact = int(value)
            if exact != value:
                raise LinkInputError(f"{self.name} takes whole numbers, not {value}")
        try:
            return struct.pack(self.format, exact)
        except (struct.error, OverflowError) as error:
            raise LinkInputError(
                f"{self.name} = {value} does not fit its type {self.format!r}: {error}"
            ) from error


def parameter_table(rows: Rows) -> dict[str, DroneVariable]:
    """The parameters by complete name.

    Raises:
        LinkError: a type that is not known.
    """
    return {
        name: DroneVariable(name, ident, 0, _format(_PARAMETER_FORMATS, code, name), bool(code & _READ_ONLY))
        for ident, (code, name) in enumerate(rows)
    }


def log_table(rows: Rows) -> dict[str, DroneVariable]:
    """The log variables by complete name.

    Raises:
        LinkError: a type that is not known.
    """
    return {
        name: DroneVariable(name, ident, code & _TYPE, _format(_LOG_FORMATS, code, name))
        for ident, (code, name) in enumerate(rows)
    }


def _format(formats: dict[int, str], code: int, name: str) -> str:
    try:
        return formats[code & _TYPE]
    except KeyError:
        raise LinkError(f"the drone says that {name} has type {code:#04x}, which is not known") from None


def find(table: dict[str, DroneVariable], name: str, kind: str) -> DroneVariable:
    """The variable of this name.

    Raises:
        NoSuchVariable: the drone does not have it.
    """
    try:
        return table[name]
    except KeyError:
        raise NoSuchVariable(
            f"the drone has no {kind} {name!r} ({len(table)} known); wrong name, or firmware without it"
        ) from None
