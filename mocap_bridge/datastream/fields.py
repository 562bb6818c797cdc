"""The field types of the DataStream wire format; each reads and writes itself.

Little-endian, packed, no padding. ``string`` and every container start with a u32 count. A count is believed
only when the bytes for that many items are there, so a damaged packet cannot make the decoder reserve memory.
"""

import struct
from collections.abc import Callable, Sequence
from typing import Any, Protocol

from mocap_bridge.errors import PacketError

_COUNT = struct.Struct("<I")


class PayloadReader:
    """A position in a block's payload."""

    __slots__ = ("data", "end", "position")

    def __init__(self, data: bytes, position: int, end: int) -> None:
        self.data = data
        self.position = position
        self.end = end

    def take(self, size: int) -> int:
        """Step over `size` bytes and give where they start; PacketError when they are not there."""
        start = self.position
        if start + size > self.end:
            raise PacketError(f"payload ends {start + size - self.end} bytes early")
        self.position = start + size
        return start

    def count(self, minimum_item_size: int) -> int:
        """A u32 count of items of at least `minimum_item_size` bytes each."""
        (n,) = _COUNT.unpack_from(self.data, self.take(4))
        if n * minimum_item_size > self.end - self.position:
            raise PacketError(f"count of {n} items does not fit the {self.end - self.position} bytes left")
        return int(n)


class WireField(Protocol):
    """How one field lies on the wire. `minimum_size` is the fewest bytes it can take."""

    minimum_size: int

    def read(self, reader: PayloadReader) -> Any:
        """Decode at the reader's position and step over it."""

    def write(self, value: Any, out: bytearray) -> None:
        """Append the encoding of `value`."""


class Scalar:
    """One number, by its `struct` code."""

    def __init__(self, code: str) -> None:
        self._struct = struct.Struct("<" + code)
        self.minimum_size = self._struct.size

    def read(self, reader: PayloadReader) -> Any:
        """The number."""
        return self._struct.unpack_from(reader.data, reader.take(self.minimum_size))[0]

    def write(self, value: Any, out: bytearray) -> None:
        """Append the number; PacketError when it does not fit the type."""
        try:
            out += self._struct.pack(value)
        except (struct.error, OverflowError) as error:
            raise PacketError(f"{value!r} cannot be encoded: {error}") from error


class Numbers:
    """A fixed number of equal numbers, as a tuple."""

    def __init__(self, count: int, code: str) -> None:
        self._struct = struct.Struct(f"<{count}{code}")
        self.minimum_size = self._struct.size

    def read(self, reader: PayloadReader) -> tuple[Any, ...]:
        """The numbers."""
        return self._struct.unpack_from(reader.data, reader.take(self.minimum_size))

    def write(self, value: Sequence[Any], out: bytearray) -> None:
        """Append the numbers; PacketError when there are not exactly as many."""
        try:
            out += self._struct.pack(*value)
        except (struct.error, OverflowError) as error:
            raise PacketError(f"{value!r} cannot be encoded: {error}") from error


class Text:
    """A counted byte string; UTF-8, and bytes that are not UTF-8 survive a round trip."""

    minimum_size = 4

    def read(self, reader: PayloadReader) -> str:
        """The text."""
        n = reader.count(1)
        start = reader.take(n)
        return reader.data[start : start + n].decode("utf-8", "surrogateescape")

    def write(self, value: str, out: bytearray) -> None:
        """Append count and bytes."""
        encoded = value.encode("utf-8", "surrogateescape")
        out += _COUNT.pack(len(encoded))
        out += encoded


class Many:
    """A counted list of equal items (vector, set, or map as a list of pairs), as a tuple."""

    minimum_size = 4

    def __init__(self, item: WireField) -> None:
        self._item = item

    def read(self, reader: PayloadReader) -> tuple[Any, ...]:
        """The items."""
        n = reader.count(self._item.minimum_size)
        return tuple([self._item.read(reader) for _ in range(n)])

    def write(self, value: Sequence[Any], out: bytearray) -> None:
        """Append count and items."""
        out += _COUNT.pack(len(value))
        for item in value:
            self._item.write(item, out)


class Record:
    """Fields one after the other; `make` builds the value from them (a NamedTuple class)."""

    def __init__(self, make: Callable[..., Any], *fields: WireField) -> None:
        self.make = make
        self._fields = fields
        self.minimum_size = sum(field.minimum_size for field in fields)

    def read(self, reader: PayloadReader) -> Any:
        """The record."""
        return self.make(*[field.read(reader) for field in self._fields])

    def write(self, value: Sequence[Any], out: bytearray) -> None:
        """Append each field."""
        for field, item in zip(self._fields, value, strict=True):
            field.write(item, out)
