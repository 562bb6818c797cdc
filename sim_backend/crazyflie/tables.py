"""Live tables behind the tables of contents: parameters with values, log variables with sources."""

import math
import struct
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Self, TypeAlias

from sim_backend.crazyflie.app_toc import app_blocks
from sim_backend.crazyflie.toc import (
    EXTENDED,
    FORMATS,
    PERSISTENT,
    READ_ONLY,
    TYPE_MASK,
    Block,
    LogType,
    ParamType,
    check_blocks,
    load_blocks,
    table_crc,
)
from sim_backend.errors import SimulationError

Number: TypeAlias = int | float
Callback: TypeAlias = Callable[[Number], Iterator[None] | None]

_END = object()


class NoSuchTableEntry(SimulationError, KeyError):
    """A parameter or log variable that the table does not have."""

    def __str__(self) -> str:
        """The message as written (a ``KeyError`` would quote it)."""
        return str(self.args[0])


class ValueNotRepresentable(SimulationError):
    """A value that does not fit the type of its variable."""


@dataclass(frozen=True, slots=True)
class TableParameter:
    """One parameter of the table of contents. ``type_byte`` is what the client is told."""

    ident: int
    group: str
    name: str
    type_byte: int
    extended_type: int
    default: Number

    @property
    def full_name(self) -> str:
        """``group.name``."""
        return f"{self.group}.{self.name}"

    @property
    def type(self) -> ParamType:
        """Type without flags."""
        return ParamType(self.type_byte & TYPE_MASK)

    @property
    def struct_format(self) -> str:
        """``struct`` format of the value, little endian."""
        return FORMATS[self.type.name]

    @property
    def length(self) -> int:
        """Bytes of the value."""
        return struct.calcsize(self.struct_format)

    @property
    def read_only(self) -> bool:
        """The client may not write it."""
        return bool(self.type_byte & READ_ONLY)

    @property
    def extended(self) -> bool:
        """It has an extended type."""
        return bool(self.type_byte & EXTENDED)

    @property
    def persistent(self) -> bool:
        """It can be stored in the drone's EEPROM."""
        return bool(self.extended_type & PERSISTENT)

    def encode(self, value: Number) -> bytes:
        """Bytes of a value.

        Raises:
            ValueNotRepresentable: the type cannot hold it.
        """
        number: Number = value
        if self.type not in (ParamType.FP16, ParamType.FLOAT, ParamType.DOUBLE):
            if not math.isfinite(value) or value != int(value):
                raise ValueNotRepresentable(
                    f"{self.full_name} = {value!r}: not an integer ({self.type.name})"
                )
            number = int(value)
        try:
            return struct.pack(self.struct_format, number)
        except (struct.error, OverflowError) as error:
            raise ValueNotRepresentable(
                f"{self.full_name} = {value!r} does not fit {self.type.name}"
            ) from error

    def decode(self, raw: bytes) -> Number:
        """Value of the first bytes of ``raw``."""
        value: Number = struct.unpack_from(self.struct_format, raw)[0]
        return value


class ParameterTable:
    """All parameters and their values.

    ``params["group.name"]`` reads and ``params["group.name"] = value`` writes from the firmware's side; a
    write queues a value-updated notice for the client unless the parameter is read-only (as ``paramSetInt``
    and ``paramSetFloat`` do).

    Client writes go through :meth:`write_raw`. A value that lives elsewhere in the firmware is bound with
    :meth:`mirror` and set at once, as a variable is. What :meth:`on_write` names is a callback: the
    firmware's parameter task runs it after the client has its answer, and does nothing else meanwhile.
    """

    def __init__(self, blocks: list[Block]) -> None:
        """Build the table; all values are defaults, nothing is stored."""
        check_blocks(blocks)
        self.crc = table_crc(blocks)
        self.entries = tuple(
            TableParameter(ident, group, row.name, row.type_byte, row.extended_type, row.default)
            for ident, (group, row) in enumerate((block.group, row) for block in blocks for row in block.rows)
        )
        self._by_name = {entry.full_name: entry for entry in self.entries}
        self._raw = [entry.encode(entry.default) for entry in self.entries]
        self._stored: dict[int, bytes] = {}
        self._mirrors: dict[int, Callable[[Number], None]] = {}
        self._callbacks: dict[int, Callback] = {}
        self._running: Iterator[None] | None = None
        self._updates: list[int] = []

    @classmethod
    def firmware(cls, with_app: bool = True) -> Self:
        """The real firmware's parameters, followed by our app's groups."""
        return cls(load_blocks("param") + (app_blocks("param") if with_app else []))

    def __len__(self) -> int:
        """Number of parameters."""
        return len(self.entries)

    def __contains__(self, name: object) -> bool:
        """Whether there is a parameter ``group.name``."""
        return name in self._by_name

    def entry(self, name: str) -> TableParameter:
        """The parameter ``group.name``.

        Raises:
            NoSuchVariable: there is none.
        """
        try:
            return self._by_name[name]
        except KeyError:
            raise NoSuchTableEntry(f"no parameter '{name}' in a table of {len(self.entries)}") from None

    def __getitem__(self, name: str) -> Number:
        """Value of ``group.name``."""
        entry = self.entry(name)
        return entry.decode(self._raw[entry.ident])

    def __setitem__(self, name: str, value: Number) -> None:
        """Set from the firmware's side; tells the client unless read-only. Calls no callback."""
        entry = self.entry(name)
        self._raw[entry.ident] = entry.encode(value)
        if not entry.read_only and entry.ident not in self._updates:
            self._updates.append(entry.ident)

    def mirror(self, name: str, setter: Callable[[Number], None]) -> None:
        """Call ``setter(value)`` with each client write: the variable behind the parameter."""
        self._mirrors[self.entry(name).ident] = setter

    def on_write(self, name: str, callback: Callback) -> None:
        """Run ``callback(value)`` in the parameter task after each client write.

        A callback that waits is a generator; each ``yield`` is a delay of 1 ms.
        """
        self._callbacks[self.entry(name).ident] = callback

    def raw(self, ident: int) -> bytes:
        """Bytes of the value."""
        return self._raw[ident]

    def default_raw(self, ident: int) -> bytes:
        """Bytes of the default value."""
        return self.entries[ident].encode(self.entries[ident].default)

    def write_raw(self, ident: int, raw: bytes) -> None:
        """A client's write. Bytes beyond the type's length are ignored, missing ones are zero."""
        length = self.entries[ident].length
        self._raw[ident] = raw[:length].ljust(length, b"\0")
        setter = self._mirrors.get(ident)
        if setter is not None:
            setter(self.entries[ident].decode(self._raw[ident]))

    def notify(self, ident: int) -> None:
        """After a client's write: the parameter task is in the callback from now on, if there is one."""
        callback = self._callbacks.get(ident)
        if callback is not None:
            self._running = _task(callback, self.entries[ident].decode(self._raw[ident]))

    @property
    def busy(self) -> bool:
        """Whether the parameter task is in a callback; the client's next packet waits for its end."""
        return self._running is not None

    def run_callback(self) -> None:
        """The parameter task's share of one ms, after the control loop.

        Raises:
            FirmwareAssertion: an assertion failed in the callback.
        """
        if self._running is not None and next(self._running, _END) is _END:
            self._running = None

    def take_updates(self) -> list[int]:
        """Ids that the firmware itself changed since the last call."""
        updates, self._updates = self._updates, []
        return updates

    def store(self, ident: int) -> bool:
        """Keep the value over a reset; False when the parameter is not persistent."""
        if not self.entries[ident].persistent:
            return False
        self._stored[ident] = self._raw[ident]
        return True

    def stored(self, ident: int) -> bytes | None:
        """The stored bytes."""
        return self._stored.get(ident)

    def clear(self, ident: int) -> bool:
        """Forget the stored value; False when nothing was stored."""
        return self._stored.pop(ident, None) is not None

    def reset(self) -> None:
        """Boot: every value is its stored or default value, no notices. Callbacks and mirrors stay and are
        not called."""
        self._raw = [self._stored.get(entry.ident, self.default_raw(entry.ident)) for entry in self.entries]
        self._updates.clear()
        self._running = None


def _task(callback: Callback, value: Number) -> Iterator[None]:
    """The parameter task in a callback; nothing of it has run yet."""
    waits = callback(value)
    if waits is not None:
        yield from waits


@dataclass(frozen=True, slots=True)
class LogVariable:
    """One log variable of the table of contents. ``type_byte`` is the firmware's, with its flags."""

    ident: int
    group: str
    name: str
    type_byte: int

    @property
    def full_name(self) -> str:
        """``group.name``."""
        return f"{self.group}.{self.name}"

    @property
    def type(self) -> LogType:
        """Type without flags: what the client is told."""
        return LogType(self.type_byte & TYPE_MASK)


_WHOLE = {
    name: limits
    for bits in (8, 16, 32)
    for name, limits in ((f"U{bits}", (0, 1 << bits)), (f"I{bits}", (-(1 << bits - 1), 1 << bits - 1)))
}
"""Lowest value of each integer type, and the first that is too large."""


class LogTable:
    """All log variables and where their values come from. A variable without a source reads 0."""

    def __init__(self, blocks: list[Block]) -> None:
        """Build the table; nothing is bound."""
        check_blocks(blocks)
        self.crc = table_crc(blocks)
        self.entries = tuple(
            LogVariable(ident, group, row.name, row.type_byte)
            for ident, (group, row) in enumerate((block.group, row) for block in blocks for row in block.rows)
        )
        self._by_name = {entry.full_name: entry for entry in self.entries}
        self._sources: dict[int, Callable[[], Number]] = {}
        self._injected: dict[int, Number] = {}

    @classmethod
    def firmware(cls, with_app: bool = True) -> Self:
        """The real firmware's log variables, followed by our app's groups."""
        return cls(load_blocks("log") + (app_blocks("log") if with_app else []))

    def __len__(self) -> int:
        """Number of variables."""
        return len(self.entries)

    def __contains__(self, name: object) -> bool:
        """Whether there is a variable ``group.name``."""
        return name in self._by_name

    def entry(self, name: str) -> LogVariable:
        """The variable ``group.name``.

        Raises:
            NoSuchVariable: there is none.
        """
        try:
            return self._by_name[name]
        except KeyError:
            raise NoSuchTableEntry(f"no log variable '{name}' in a table of {len(self.entries)}") from None

    def bind(self, name: str, source: Callable[[], Number]) -> None:
        """Read ``group.name`` from ``source`` from now on."""
        self._sources[self.entry(name).ident] = source

    def bind_all(self, sources: Mapping[str, Callable[[], Number]]) -> None:
        """Bind several variables."""
        for name, source in sources.items():
            self.bind(name, source)

    def inject(self, name: str, value: Number | None) -> None:
        """Show clients `value` for ``group.name`` from now on, whatever its source gives; None ends that.

        Raises:
            NoSuchVariable: there is none.
            ValueNotRepresentable: its type cannot hold the value.
        """
        entry = self.entry(name)
        if value is not None and (bits := _WHOLE.get(entry.type.name)) is not None:
            lowest, beyond = bits
            if value != int(value) or not lowest <= value < beyond:
                raise ValueNotRepresentable(f"{name} = {value:g} does not fit {entry.type.name}")
        ident = entry.ident
        self._injected.pop(ident, None)
        if value is not None:
            self._injected[ident] = value

    def __getitem__(self, name: str) -> Number:
        """Value of ``group.name``; see :meth:`value`."""
        return self.value(self.entry(name).ident)

    def value(self, ident: int) -> Number:
        """Value of a variable: the injected one, else as its source gives it, 0 without a source."""
        if ident in self._injected:
            return self._injected[ident]
        source = self._sources.get(ident)
        return 0 if source is None else source()
