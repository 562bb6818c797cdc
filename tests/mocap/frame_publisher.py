"""A DataStream server that publishes frames of known content, on an event loop in a thread."""

import asyncio
import threading
import time
from collections.abc import Callable
from typing import Self

from sim_backend.room.cameras import CameraFrame, SeenBody
from sim_backend.room.datastream_server import DataStreamServer


class FramePublisher:
    """Publishes ``bodies(n)`` as frame n at `rate_hz` from entry to exit.

    Attributes:
        sent: time at which each frame was handed to the sockets (s, monotonic), by frame number.
    """

    def __init__(self, bodies: Callable[[int], tuple[SeenBody, ...]], rate_hz: float, port: int = 0) -> None:
        self._bodies = bodies
        self._rate_hz = rate_hz
        self.port = port
        self.sent: dict[int, float] = {}
        self._ready = threading.Event()
        self._stop = threading.Event()
        self._thread = threading.Thread(target=lambda: asyncio.run(self._serve()), name="frame-publisher")

    async def _serve(self) -> None:
        server = DataStreamServer(self._rate_hz)
        self.port = await server.start("127.0.0.1", self.port)
        self._ready.set()
        start = time.monotonic()
        number = 0
        while not self._stop.is_set():
            number += 1
            due = start + number / self._rate_hz
            await asyncio.sleep(max(0.0, due - time.monotonic()))
            frame = CameraFrame(number, due, self._bodies(number))
            self.sent[number] = time.monotonic()
            server.publish(frame, 0.003)
        await server.close()

    def __enter__(self) -> Self:
        self._thread.start()
        self._ready.wait()
        return self

    def __exit__(self, *error: object) -> None:
        self._stop.set()
        self._thread.join()
