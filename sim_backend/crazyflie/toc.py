"""The firmware's tables of contents (TOC): rows, text files, CRC.

The tables are facts of bitcraze/crazyflie-firmware 2a18fc29 (2026.08, default build for cf2): 567 log
variables and 335 parameters, in the order of their ids. They ship as ``toc/log.tsv`` and ``toc/param.tsv``,
one line a variable, columns ``group  name  type  flags  default`` separated by tabs. A line whose group is
not empty opens a block, that is the rows between a group's start and stop row in the firmware; the same
group may be opened again.

Flags: ``c`` core, ``r`` read-only, ``p`` persistent (both parameters only), ``f`` read by a function (logs
only).

The type byte as the firmware has it (``log.h``, ``param.h``)::

    log    bits 0-3 type, 0x20 core, 0x40 by function, 0x80 group row (bit 0: start)
    param  bits 0-3 type, 0x10 extended, 0x20 core, 0x40 read-only, 0x80 group row (bit 0: start)
"""

import struct
import zlib
from collections.abc import Iterable, Sequence
from enum import IntEnum
from pathlib import Path
from typing import NamedTuple

from onboard.errors import InputError
from sim_backend.errors import SimulationError

TOC_FOLDER = Path(__file__).parent / "toc"

TYPE_MASK = 0x0F
EXTENDED = 0x10
CORE = 0x20
READ_ONLY = 0x40
BY_FUNCTION = 0x40
GROUP_START = 0x81
GROUP_STOP = 0x80
PERSISTENT = 1  # extended type

#: A group and a name must leave room for the 4 bytes in front of them in one packet, both with a closing
#: zero.
NAMES_MAX = 26


class TocError(SimulationError, InputError):
    """A table of contents that cannot be used."""


class LogType(IntEnum):
    """Types of log variables on the wire."""

    U8 = 1
    U16 = 2
    U32 = 3
    I8 = 4
    I16 = 5
    I32 = 6
    FLOAT = 7
    FP16 = 8


class ParamType(IntEnum):
    """Types of parameters on the wire: bits 0-1 size, bit 2 floating point, bit 3 unsigned."""

    I8 = 0x00
    I16 = 0x01
    I32 = 0x02
    I64 = 0x03
    FP16 = 0x05
    FLOAT = 0x06
    DOUBLE = 0x07
    U8 = 0x08
    U16 = 0x09
    U32 = 0x0A
    U64 = 0x0B


#: ``struct`` format of each type by its name; all are little endian.
FORMATS = {
    **{"U8": "<B", "U16": "<H", "U32": "<I", "U64": "<Q", "I8": "<b", "I16": "<h", "I32": "<i", "I64": "<q"},
    **{"FP16": "<e", "FLOAT": "<f", "DOUBLE": "<d"},
}

_FLAGS: dict[str, dict[str, int]] = {
    "log": {"c": CORE, "f": BY_FUNCTION},
    "param": {"p": EXTENDED, "c": CORE, "r": READ_ONLY},
}
_TYPES: dict[str, type[LogType] | type[ParamType]] = {"log": LogType, "param": ParamType}


class Row(NamedTuple):
    """One variable: its name, the firmware's type byte, extended type and default value (parameters)."""

    name: str
    type_byte: int
    extended_type: int = 0
    default: float | int = 0


class Block(NamedTuple):
    """The rows between one start and one stop row of a group."""

    group: str
    rows: tuple[Row, ...]


def table_crc(blocks: Iterable[Block]) -> int:
    """CRC32 of a table as ``logInit`` and ``paramLogicInit`` chain it over all rows, group rows included."""
    crc = 0
    for block in blocks:
        crc = _chain(crc, GROUP_START, block.group)
        for row in block.rows:
            crc = _chain(crc, row.type_byte, row.name)
        crc = _chain(crc, GROUP_STOP, f"stop_{block.group}")
    return crc


def _chain(crc: int, type_byte: int, name: str) -> int:
    return zlib.crc32(struct.pack("<IB", crc, type_byte) + name.encode("ascii"))


def format_blocks(kind: str, blocks: Sequence[Block]) -> str:
    """Text of a table file; ``kind`` is ``log`` or ``param``."""
    lines = [
        f"# {kind} table of contents: facts of bitcraze/crazyflie-firmware 2a18fc29 (2026.08), cf2",
        f"# CRC {table_crc(blocks):08X}; columns and flags are explained in sim_backend/crazyflie/toc.py",
        "group\tname\ttype\tflags\tdefault",
    ]
    for block in blocks:
        for index, row in enumerate(block.rows):
            flags = "".join(flag for flag, bit in _FLAGS[kind].items() if row.type_byte & bit)
            default = repr(row.default) if kind == "param" else ""
            group = block.group if index == 0 else ""
            cells = (group, row.name, _type_name(kind, row.type_byte), flags, default)
            lines.append("\t".join(cells).rstrip("\t"))
    return "\n".join(lines) + "\n"


def _type_name(kind: str, type_byte: int) -> str:
    return _TYPES[kind](type_byte & TYPE_MASK).name.lower()


def load_blocks(kind: str, path: Path | None = None) -> list[Block]:
    """Read a table file; ``kind`` is ``log`` or ``param``.

    Raises:
        TocError: a line that cannot be used, with file and line.
    """
    path = path or TOC_FOLDER / f"{kind}.tsv"
    blocks: list[Block] = []
    for number, line in enumerate(path.read_text(encoding="utf-8").splitlines(), start=1):
        if line.startswith("#") or line.startswith("group\t") or not line:
            continue
        try:
            group, row = _parse_line(kind, line)
        except (ValueError, KeyError) as error:
            raise TocError(f"{path}:{number}: {line!r} is no table row ({error}), see {__name__}") from error
        if group:
            blocks.append(Block(group, ()))
        elif not blocks:
            raise TocError(f"{path}:{number}: the first row names no group")
        blocks[-1] = Block(blocks[-1].group, (*blocks[-1].rows, row))
    check_blocks(blocks)
    return blocks


def _parse_line(kind: str, line: str) -> tuple[str, Row]:
    group, name, type_name, flags, default = [*line.split("\t"), "", ""][:5]
    type_byte = int(_TYPES[kind][type_name.upper()])
    for flag in flags:
        type_byte |= _FLAGS[kind][flag]
    value = float(default) if type_name in ("fp16", "float", "double") and default else int(default or 0)
    return group, Row(name, type_byte, PERSISTENT if "p" in flags else 0, value)


def check_blocks(blocks: Iterable[Block]) -> None:
    """Refuse what the firmware refuses at start.

    Raises:
        TocError: a name too long for one packet, or given twice.
    """
    seen: set[str] = set()
    for block in blocks:
        for row in block.rows:
            full = f"{block.group}.{row.name}"
            if len(block.group) + len(row.name) + 2 > NAMES_MAX:
                raise TocError(f"'{full}' is too long: group and name share {NAMES_MAX - 2} characters")
            if full in seen:
                raise TocError(f"'{full}' is in the table twice")
            seen.add(full)
