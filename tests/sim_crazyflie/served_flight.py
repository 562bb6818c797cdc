"""A simulated flight that a link reaches: its world and its server live on a thread, in real time."""

import asyncio
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TypeVar

from sim_backend.crazyflie.server import CrazyflieServer
from tests.patience import PATIENCE_S
from tests.sim_crazyflie.simulated_flight import Flight

ROUND_S = 0.002
T = TypeVar("T")


class ServedFlight:
    """`call` runs something between two rounds of the world, on its thread."""

    def __init__(self, flight: Flight, uri: str, loop: asyncio.AbstractEventLoop) -> None:
        self.flight = flight
        self.uri = uri
        self._loop = loop

    def call(self, function: Callable[[], T]) -> T:
        async def run() -> T:
            return function()

        return asyncio.run_coroutine_threadsafe(run(), self._loop).result(PATIENCE_S)


async def _live(flight: Flight, server: CrazyflieServer) -> None:
    """Rounds of 2 ms; a machine that is late lets the world run late."""
    while True:
        due = time.monotonic() + ROUND_S
        for _ in range(2):
            flight.tick()
        server.poll(flight.world.time)
        await asyncio.sleep(max(0.0, due - time.monotonic()))


@contextmanager
def serve_flight(flight: Flight) -> Iterator[ServedFlight]:
    """Serve `flight` on a free port; a world that breaks fails the test at the end."""
    loop = asyncio.new_event_loop()
    thread = threading.Thread(target=loop.run_forever, name="served flight")
    thread.start()
    server = CrazyflieServer(flight.firmware)
    served = None
    living = None
    try:
        asyncio.run_coroutine_threadsafe(server.start(), loop).result(PATIENCE_S)
        served = ServedFlight(flight, server.uri, loop)
        living = asyncio.run_coroutine_threadsafe(_live(flight, server), loop)
        yield served
        if living.done():
            living.result()
    finally:
        if living is not None:
            living.cancel()
        if served is not None:
            served.call(server.close)
        loop.call_soon_threadsafe(loop.stop)
        thread.join(PATIENCE_S)
        loop.close()
