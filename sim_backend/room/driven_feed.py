"""The feed of a room that lives in the lab's time: updates, and the room's word that they are dealt with.

Datagrams as in :mod:`sim_backend.room.feed`: updates wait for the one after which a frame is due, and go with
it. To that one, with the flag :data:`ANSWER`, the room answers with one JSON object, ``{"t": world time,
"sent": {key: packets}}``: all frames that were due are sent, and so many packets have gone to each client so
far (keys as in :mod:`onboard.lab_time.messages`).
"""

import asyncio
import json
from collections.abc import Iterable

from onboard.arrays import Quaternion, Vector
from sim_backend.room.feed import FeedUpdate, TruePose, encode_feed
from sim_backend.room.settings import RoomError

ANSWER_LIMIT_S = 60.0
_DATAGRAM_BYTES = 16384
"""Updates that are more than this do not wait."""


class DrivenFeed(asyncio.DatagramProtocol):
    """The lab's end.

    Attributes:
        sent: packets to each client of the room, as it last said.
    """

    def __init__(self) -> None:
        self.sent: dict[str, int] = {}
        self._waiting = bytearray()
        self._transport: asyncio.DatagramTransport | None = None
        self._answered = asyncio.Event()
        self._answered_time = -1.0
        self._gone = False

    async def open(self, port: int, host: str) -> None:
        """Connect to the room."""
        loop = asyncio.get_running_loop()
        self._transport, _ = await loop.create_datagram_endpoint(lambda: self, remote_addr=(host, port))

    def datagram_received(self, data: bytes, addr: tuple[str, int]) -> None:
        """The room's word."""
        answer = json.loads(data)
        self.sent = answer["sent"]
        self._answered_time = float(answer["t"])
        self._answered.set()

    def send(
        self, world_time: float, bodies: Iterable[tuple[str, Vector, Quaternion]], *, answer: bool
    ) -> None:
        """Send an update; one without `answer` goes later, with the next that has it."""
        if self._transport is None or self._gone:
            return
        update = FeedUpdate(world_time, {name: TruePose(p, q) for name, p, q in bodies})
        self._waiting += encode_feed(update, answer=answer)
        if answer or len(self._waiting) > _DATAGRAM_BYTES:
            self._transport.sendto(bytes(self._waiting))
            self._waiting.clear()

    async def dealt_with(self, world_time: float) -> None:
        """Wait until the room has dealt with the update of `world_time`, or is gone.

        Raises:
            RoomError: it is silent for 60 s.
        """
        while self._answered_time < world_time and not self._gone:
            self._answered.clear()
            try:
                async with asyncio.timeout(ANSWER_LIMIT_S):
                    await self._answered.wait()
            except TimeoutError:
                raise RoomError(
                    f"the mocap room has said nothing for {ANSWER_LIMIT_S:g} s: it hangs or is stopped"
                ) from None

    def room_is_gone(self) -> None:
        """Do not wait for it any more."""
        self._gone = True
        self._answered.set()

    def close(self) -> None:
        """Close the socket."""
        if self._transport is not None:
            self._transport.close()
