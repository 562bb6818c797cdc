"""A simulated room in a thread of the test's own process."""

import asyncio
import threading
import time
from types import TracebackType
from typing import Self

import numpy as np

from onboard.clock import Clock
from sim_backend.room.serve import RoomServer
from sim_backend.room.settings import RoomError, RoomSettings


class RoomThread:
    """A room on an event loop of its own: a context manager."""

    def __init__(
        self, settings: RoomSettings, rng: np.random.Generator, clock: Clock = time.monotonic
    ) -> None:
        self._settings = settings
        self._rng = rng
        self._clock = clock
        self._ready = threading.Event()
        self._error: RoomError | None = None
        self._loop: asyncio.AbstractEventLoop | None = None
        self._stop: asyncio.Event | None = None
        self._thread = threading.Thread(target=lambda: asyncio.run(self._serve()), name="simulated-room")
        self.server: RoomServer

    async def _serve(self) -> None:
        self._loop = asyncio.get_running_loop()
        self._stop = asyncio.Event()
        self.server = RoomServer(self._settings, self._rng, self._clock)
        try:
            await self.server.start()
        except RoomError as error:
            self._error = error
            return
        finally:
            self._ready.set()
        await self._stop.wait()
        await self.server.close()

    def __enter__(self) -> Self:
        self._thread.start()
        self._ready.wait()
        if self._error is not None:
            self._thread.join()
            raise self._error
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._loop is not None and self._stop is not None:
            self._loop.call_soon_threadsafe(self._stop.set)
        self._thread.join()
