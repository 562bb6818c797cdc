"""The hands protocol over TCP: one JSON object a line, one reply line a request, in order."""

import asyncio
import contextlib
import json
from collections.abc import Awaitable, Callable
from typing import Any

from sim_backend.bench.errors import BenchError
from sim_backend.bench.operator import Request, SimulatedOperator

LINE_MAX = 1 << 16

WaitUntil = Callable[[float], Awaitable[None]]


class AssistantServer:
    """Serves an operator.

    Args:
        operator: who does the work.
        wait_until: waits for a bench time (s).
        host: local address.
    """

    def __init__(self, operator: SimulatedOperator, wait_until: WaitUntil, host: str) -> None:
        self._operator = operator
        self._wait_until = wait_until
        self._host = host
        self._server: asyncio.Server | None = None
        self._clients: set[asyncio.StreamWriter] = set()

    async def start(self) -> None:
        """Accept connections on a free port."""
        self._server = await asyncio.start_server(self._serve, self._host, 0, limit=LINE_MAX)

    @property
    def address(self) -> str:
        """``tcp://HOST:PORT``.

        Raises:
            BenchError: not started.
        """
        if self._server is None:
            raise BenchError("the hands are not served; await start() first")
        host, port = self._server.sockets[0].getsockname()[:2]
        return f"tcp://{host}:{port}"

    async def close(self) -> None:
        """Close all connections."""
        for writer in self._clients:
            writer.close()
        if self._server is not None:
            self._server.close()
            await self._server.wait_closed()

    async def _serve(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        self._clients.add(writer)
        try:
            with contextlib.suppress(ConnectionError):
                await self._answer(reader, writer)
        finally:
            self._clients.discard(writer)
            writer.close()

    async def _answer(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        while True:
            try:
                line = await reader.readline()
            except ValueError:
                # The stream is out of step after a line without an end: say so and hang up.
                await _send(writer, {"error": f"a line of more than {LINE_MAX} bytes"})
                return
            if not line:
                return
            request = _parse(line)
            if request is None:
                await _send(writer, {"error": "write one JSON object a line"})
                continue
            reply = self._operator.perform(request)
            await self._wait_until(reply.at)
            await _send(writer, reply.document)


async def _send(writer: asyncio.StreamWriter, document: dict[str, Any]) -> None:
    writer.write(json.dumps(document).encode() + b"\n")
    await writer.drain()


def _parse(line: bytes) -> Request | None:
    """The request, None when the line is not a JSON object."""
    try:
        document = json.loads(line)
    except ValueError:
        return None
    return document if isinstance(document, dict) else None
