"""The drone's tables of contents, typed: which parameters and log variables exist, and how they look on the
wire."""

import struct
from dataclasses import dataclass
from typing import Any

from cflib.crazyflie.log import LogTocElement
from cflib.crazyflie.param import ParamTocElement

from onboard.link.errors import LinkInputError, NoSuchVariable


@dataclass(frozen=True, slots=True)
class Variable:
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


def parameter_table(toc: dict[str, dict[str, Any]]) -> dict[str, Variable]:
    """The parameters by complete name, from cflib's table."""
    return {
        f"{group}.{name}": Variable(
            f"{group}.{name}", entry.ident, 0, entry.pytype, entry.access == ParamTocElement.RO_ACCESS
        )
        for group, entries in toc.items()
        for name, entry in entries.items()
    }


def log_table(toc: dict[str, dict[str, Any]]) -> dict[str, Variable]:
    """The log variables by complete name, from cflib's table."""
    return {
        f"{group}.{name}": Variable(
            f"{group}.{name}", entry.ident, LogTocElement.get_id_from_cstring(entry.ctype), entry.pytype
        )
        for group, entries in toc.items()
        for name, entry in entries.items()
    }


def find(table: dict[str, Variable], name: str, kind: str) -> Variable:
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
