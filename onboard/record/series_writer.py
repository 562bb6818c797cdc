"""Write ``series.mcap``, byte for byte as mcap's own ``Writer`` does without chunks, at a fifth of its time.

A flight writes a thousand messages in a second of its time, each at once and in the flight's own process.
"""

import struct
import zlib
from typing import Protocol

from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from mcap.records import (
    Channel,
    DataEnd,
    Footer,
    Header,
    McapRecord,
    Metadata,
    Schema,
    Statistics,
    SummaryOffset,
)
from mcap.well_known import MessageEncoding, SchemaEncoding

MAGIC = bytes((0x89, 77, 67, 65, 80, 0x30, 0x0D, 0x0A))
_MESSAGE = struct.Struct("<BQHIQQ")
"""Opcode and length of the record; channel, sequence, log and publish time (ns)."""
_LENGTH_AFTER_HEAD = _MESSAGE.size - 9
_FOOTER = struct.Struct("<BQQQ")
_FOOTER_LENGTH = 20


class ByteStream(Protocol):
    """Where the file goes."""

    def write(self, data: bytes) -> object:
        """Append `data`."""

    def tell(self) -> int:
        """Bytes so far."""


class SeriesWriter:
    """The messages of a run, unchunked, as JSON, with a CRC-32 of them all at the end.

    Args:
        stream: gets each message in one ``write``.
        schemas: JSON schema of each topic, in the order of their channels.
        metadata: of the file, by its name.
    """

    def __init__(
        self, stream: ByteStream, schemas: dict[str, bytes], metadata: tuple[str, dict[str, str]]
    ) -> None:
        self._stream = stream
        self._schemas = [
            Schema(id=number, data=data, encoding=SchemaEncoding.JSONSchema, name=f"perchhw.{topic}")
            for number, (topic, data) in enumerate(schemas.items(), start=1)
        ]
        self._channels = [
            Channel(
                id=number, topic=topic, message_encoding=MessageEncoding.JSON, schema_id=number, metadata={}
            )
            for number, topic in enumerate(schemas, start=1)
        ]
        self._numbers = {channel.topic: channel.id for channel in self._channels}
        self._sequence = dict.fromkeys(schemas, 0)
        self._first_ns, self._last_ns = 0, 0
        self._counts: dict[int, int] = {}
        self._crc = 0
        self._write(MAGIC)
        self._write(_encoded(Header(profile="", library="perchhw")))
        described = zip(self._schemas, self._channels, strict=True)
        self._write(_encoded(*(record for pair in described for record in pair)))
        name, content = metadata
        self._write(_encoded(Metadata(name=name, metadata=content)))

    def add(self, topic: str, time_ns: int, data: bytes) -> None:
        """Append a message: JSON, at a time (ns)."""
        number = self._numbers[topic]
        sequence = self._sequence[topic] + 1
        length = _LENGTH_AFTER_HEAD + len(data)
        self._write(_MESSAGE.pack(Opcode.MESSAGE, length, number, sequence, time_ns, time_ns) + data)
        self._sequence[topic] = sequence  # only of what the disk took
        self._first_ns = min(time_ns, self._first_ns) if self._counts else time_ns
        self._last_ns = max(time_ns, self._last_ns)
        self._counts[number] = sequence

    def finish(self) -> None:
        """Write what stands at the end of the file."""
        self._write(_encoded(DataEnd(self._crc)))
        start = self._stream.tell()
        statistics = Statistics(
            attachment_count=0,
            channel_count=len(self._channels),
            channel_message_counts=self._counts,
            chunk_count=0,
            message_count=sum(self._counts.values()),
            metadata_count=1,
            message_start_time=self._first_ns,
            message_end_time=self._last_ns,
            schema_count=len(self._schemas),
        )
        summary, offsets = b"", []
        for opcode, records in (
            (Opcode.SCHEMA, self._schemas),
            (Opcode.CHANNEL, self._channels),
            (Opcode.STATISTICS, [statistics]),
        ):
            group = _encoded(*records)
            offsets.append(SummaryOffset(opcode, start + len(summary), len(group)))
            summary += group
        offset_start = start + len(summary)
        summary += _encoded(*offsets)
        crc = zlib.crc32(
            _FOOTER.pack(Opcode.FOOTER, _FOOTER_LENGTH, start, offset_start), zlib.crc32(summary)
        )
        self._stream.write(summary)
        self._stream.write(_encoded(Footer(start, offset_start, crc)) + MAGIC)

    def _write(self, data: bytes) -> None:
        self._stream.write(data)
        self._crc = zlib.crc32(data, self._crc)


def _encoded(*records: McapRecord) -> bytes:
    builder = RecordBuilder()
    for record in records:
        record.write(builder)
    encoded: bytes = builder.end()
    return encoded
