"""Decode a log of the Crazyflie's micro-SD card deck.

The format, little endian (Bitcraze crazyflie-firmware, tools/usdlog and usddeck.c)::

    u8  0xBC
    u16 version, 1 or 2
    u16 number of event types
    per event type:
        u16 id, text name, u16 number of variables, per variable: text "name(c)"
    per event:
        u16 id; u32 time in ms (version 1) or u64 time in us (version 2); the variables, packed
    u32 CRC-32 of all bytes before

Texts end with a zero byte; c is the type as in Python's :mod:`struct`. The CRC is written when the log is
stopped: a log that ends with the battery has none.
"""

import struct
from dataclasses import dataclass
from pathlib import Path
from zlib import crc32

import numpy as np

from calibration.flights.flight import FlightFileError
from onboard.arrays import FloatArray

MAGIC = 0xBC

_HEAD = struct.Struct("<BHH")
_U16 = struct.Struct("<H")
_CRC = struct.Struct("<I")
_TIME = {1: ("<u4", 1e-3), 2: ("<u8", 1e-6)}
"""By version: type of the time, and its unit in s."""
_TYPES = {
    **{"b": "i1", "B": "u1", "h": "<i2", "H": "<u2", "i": "<i4", "I": "<u4", "l": "<i4", "L": "<u4"},
    **{"q": "<i8", "Q": "<u8", "e": "<f2", "f": "<f4", "d": "<f8", "?": "u1"},
}


@dataclass(frozen=True)
class UsdEvents:
    """All events of one type.

    Attributes:
        t: drone time (s), shape (n,).
        values: by variable, each shape (n,).
    """

    t: FloatArray
    values: dict[str, FloatArray]


@dataclass(frozen=True)
class UsdLog:
    """A decoded log.

    Attributes:
        events: by name of the event type.
        closed: whether the log was stopped properly (it ends with its CRC).
        left_out: bytes of a torn event at the end.
    """

    events: dict[str, UsdEvents]
    closed: bool
    left_out: int


@dataclass(frozen=True)
class _EventType:
    name: str
    dtype: np.dtype
    variables: tuple[str, ...]


def read_usd(path: Path) -> UsdLog:
    """Decode the log `path`.

    Raises:
        FlightFileError: not such a log, or damaged; names the byte.
    """
    data = path.read_bytes()
    types, start, unit = _Header(path, data).read()
    closed = len(data) >= start + _CRC.size and crc32(data[:-4]) == _CRC.unpack(data[-4:])[0]
    end = len(data) - _CRC.size if closed else len(data)
    offsets, last = _events(path, data, types, start, end)
    left_out = end - last
    if not closed and left_out == _CRC.size:
        raise FlightFileError(f"{path} byte {last}: CRC-32 does not match: the file is damaged")
    buffer = np.frombuffer(data, dtype=np.uint8)
    events = {}
    for event_id, event_type in types.items():
        at = np.array(offsets[event_id], dtype=np.int64)
        size = event_type.dtype.itemsize
        rows = buffer[at[:, None] + np.arange(size)].reshape(-1).view(event_type.dtype)
        events[event_type.name] = UsdEvents(
            rows["time"].astype(np.float64) * unit,
            {name: rows[f"v{i}"].astype(np.float64) for i, name in enumerate(event_type.variables)},
        )
    return UsdLog(events, closed, left_out)


class _Header:
    """Cursor over the head of a file."""

    def __init__(self, path: Path, data: bytes) -> None:
        self._path = path
        self._data = data
        self._at = 0

    def read(self) -> tuple[dict[int, _EventType], int, float]:
        """Event types by id, where the events begin, and the unit of time (s)."""
        data, path = self._data, self._path
        if len(data) < _HEAD.size or data[0] != MAGIC:
            raise FlightFileError(f"{path} byte 0: not a micro-SD log (it begins with 0x{MAGIC:02X})")
        _, version, count = _HEAD.unpack_from(data)
        if version not in _TIME:
            known = ", ".join(str(v) for v in _TIME)
            raise FlightFileError(f"{path} byte 1: version {version} of the format; known are {known}")
        self._at = _HEAD.size
        time_type, unit = _TIME[version]
        types = {}
        for _ in range(count):
            place = self._at
            event_id = self._u16()
            if event_id in types:
                raise FlightFileError(f"{path} byte {place}: event type {event_id} described twice")
            name = self._text()
            variables = [self._variable() for _ in range(self._u16())]
            fields = [("id", "<u2"), ("time", time_type)]
            fields += [(f"v{i}", kind) for i, (_, kind) in enumerate(variables)]
            types[event_id] = _EventType(name, np.dtype(fields), tuple(v for v, _ in variables))
        return types, self._at, unit

    def _u16(self) -> int:
        if self._at + _U16.size > len(self._data):
            raise FlightFileError(f"{self._path} byte {self._at}: the file ends within its header")
        (value,) = _U16.unpack_from(self._data, self._at)
        self._at += _U16.size
        return int(value)

    def _text(self) -> str:
        end = self._data.find(b"\0", self._at)
        if end < 0:
            raise FlightFileError(f"{self._path} byte {self._at}: a name without end in the header")
        try:
            text = self._data[self._at : end].decode("ascii")
        except UnicodeDecodeError:
            raise FlightFileError(f"{self._path} byte {self._at}: a name that is not ASCII") from None
        self._at = end + 1
        return text

    def _variable(self) -> tuple[str, str]:
        place = self._at
        text = self._text()
        if len(text) < 4 or text[-3] != "(" or text[-1] != ")" or text[-2] not in _TYPES:
            raise FlightFileError(
                f"{self._path} byte {place}: variable {text!r} is not a name and a type, such as 'acc.x(f)'"
            )
        return text[:-3], _TYPES[text[-2]]


def _events(
    path: Path, data: bytes, types: dict[int, _EventType], start: int, end: int
) -> tuple[dict[int, list[int]], int]:
    """Where the events of each type begin, and the end of the last complete one."""
    sizes = {event_id: event_type.dtype.itemsize for event_id, event_type in types.items()}
    offsets: dict[int, list[int]] = {event_id: [] for event_id in types}
    at = start
    while at + _U16.size <= end:
        event_id = data[at] | data[at + 1] << 8
        size = sizes.get(event_id)
        if size is None:
            if end - at <= _CRC.size:  # what is left of a CRC that does not fit
                break
            raise FlightFileError(
                f"{path} byte {at}: event of type {event_id}, which the header does not have"
            )
        if at + size > end:
            break
        offsets[event_id].append(at)
        at += size
    return offsets, at
