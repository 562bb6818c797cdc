"""A Vicon DataStream server (TCP): ServerPush and ClientPull, several clients, reconnects.

The exchange: on connection the server sends ObjectEnums with the ids it supports; the client answers with
those it wants and with RequestFrame 1 (push) or 0 (one frame now) or RequestNextFrame n (the next n new
frames). Pings are echoed. A client may enlarge its set at any time. Every packet holds all static objects,
because a packet with any of them replaces the client's whole static state.
"""

import asyncio
import socket
from collections import Counter
from functools import lru_cache

from mocap_bridge.datastream.objects import (
    OBJECT_IDS,
    ObjectEnums,
    PacketContents,
    Ping,
    RequestFrame,
    RequestNextFrame,
    StreamObject,
)
from mocap_bridge.datastream.packet import (
    PacketBuffer,
    decode_packet,
    encode_block,
    encode_packet,
    join_blocks,
)
from mocap_bridge.errors import PacketError
from sim_backend.room.cameras import CameraFrame
from sim_backend.room.frame_objects import FRAME_OBJECTS, STANDING, frame_objects

_CONTENTS_ID = OBJECT_IDS[PacketContents]
SUPPORTED_IDS = tuple(sorted({OBJECT_IDS[kind] for kind in FRAME_OBJECTS} | {OBJECT_IDS[Ping], _CONTENTS_ID}))
# A client that does not read: frames are left out for it rather than queued without end.
_BACKLOG_BYTES = 256 * 1024


_KINDS = {OBJECT_IDS[kind]: kind for kind in FRAME_OBJECTS}

_standing_block = lru_cache(maxsize=1024, typed=True)(encode_block)
"""Of an object that is the same in every frame."""


class _EncodedFrame:
    """A frame, put together and encoded once for each set of wanted ids."""

    def __init__(self, frame: CameraFrame, rate_hz: float, latency: float) -> None:
        self._frame, self._rate_hz, self._latency = frame, rate_hz, latency
        self._packets: dict[frozenset[int], bytes] = {}

    def packet(self, wanted: frozenset[int]) -> bytes:
        """The packet for a client that wants these ids."""
        if wanted not in self._packets:
            kinds = {_KINDS[object_id] for object_id in wanted if object_id in _KINDS}
            chosen = frame_objects(self._frame, self._rate_hz, self._latency, kinds)
            blocks = [
                _standing_block(item) if type(item) in STANDING else encode_block(item) for item in chosen
            ]
            if _CONTENTS_ID in wanted:
                counts = Counter(OBJECT_IDS[type(item)] for item in chosen)
                blocks.insert(0, encode_block(PacketContents(tuple(sorted(counts.items())), ())))
            self._packets[wanted] = join_blocks(blocks)
        return self._packets[wanted]


class _Client(asyncio.Protocol):
    """One connected client, by its TCP port, and the packets that it was sent."""

    def __init__(self, server: "DataStreamServer") -> None:
        self._server = server
        self._buffer = PacketBuffer()
        self._transport: asyncio.Transport | None = None
        self._wanted: frozenset[int] = frozenset()
        self._streaming = False
        self._frames_owed = 0
        self.port, self.packets = 0, 0

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        if not isinstance(transport, asyncio.Transport):
            raise TypeError(f"a stream transport was expected, not {type(transport).__name__}")
        self._transport = transport
        transport.get_extra_info("socket").setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self._server.clients.add(self)
        self.port = transport.get_extra_info("peername")[1]
        self._write(encode_packet([ObjectEnums(SUPPORTED_IDS)]))

    def connection_lost(self, exc: Exception | None) -> None:
        self._server.clients.discard(self)
        self._transport = None

    def data_received(self, data: bytes) -> None:
        try:
            self._buffer.feed(data)
            while (packet := self._buffer.next_packet()) is not None:
                for item in decode_packet(packet):
                    self._obey(item)
        except PacketError:
            self.abort()

    def _obey(self, item: StreamObject) -> None:
        if isinstance(item, ObjectEnums):
            self._wanted = frozenset(item.ids) & frozenset(SUPPORTED_IDS)
        elif isinstance(item, RequestFrame):
            self._streaming = bool(item.streaming)
            if not item.streaming and self._server.newest is not None:
                self._write(self._server.newest.packet(self._wanted))
        elif isinstance(item, RequestNextFrame):
            self._frames_owed = item.frames
        elif isinstance(item, Ping):
            self._write(encode_packet([item]))

    def send_frame(self, frame: _EncodedFrame) -> None:
        """Push a new frame if this client asked for it."""
        if self._streaming or self._frames_owed > 0:
            self._frames_owed = max(0, self._frames_owed - 1)
            self._write(frame.packet(self._wanted))

    def _write(self, packet: bytes) -> None:
        if self._transport is not None and self._transport.get_write_buffer_size() < _BACKLOG_BYTES:
            self._transport.write(packet)
            self.packets += 1

    def abort(self) -> None:
        """Close the connection at once."""
        if self._transport is not None:
            self._transport.abort()


class DataStreamServer:
    """Listens for clients and sends them frames."""

    def __init__(self, rate_hz: float) -> None:
        self.clients: set[_Client] = set()
        self.newest: _EncodedFrame | None = None
        self._rate_hz = rate_hz
        self._listener: asyncio.Server | None = None

    async def start(self, host: str, port: int) -> int:
        """Listen; gives the port that was taken. OSError when it cannot be."""
        loop = asyncio.get_running_loop()
        self._listener = await loop.create_server(lambda: _Client(self), host, port)
        return int(self._listener.sockets[0].getsockname()[1])

    def publish(self, frame: CameraFrame, latency: float) -> None:
        """Send a frame to every client that streams or has asked for it; `latency` (s) is reported in it."""
        self.newest = _EncodedFrame(frame, self._rate_hz, latency)
        for client in tuple(self.clients):
            client.send_frame(self.newest)

    def packets_sent(self) -> dict[str, int]:
        """Packets to each client so far, by ``tcp:PORT``."""
        return {f"tcp:{client.port}": client.packets for client in self.clients}

    def stop(self) -> None:
        """Stop listening and drop every client, at once."""
        if self._listener is not None:
            self._listener.close()
        for client in tuple(self.clients):
            client.abort()

    async def close(self) -> None:
        """As :meth:`stop`, and wait until everything is closed."""
        self.stop()
        if self._listener is not None:
            await self._listener.wait_closed()
            self._listener = None
