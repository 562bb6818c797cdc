"""A lab whose time waits for everyone who takes part in it.

The world goes on by 2 ms when everything that was sent until now, either way, has been dealt with and every
participant has said that its turn is over. Where nobody takes part, and nothing moves, time stands still;
what a process that died left in the air comes down, and its watchdogs bite. A client that takes no part finds
a lab in real time as long as it talks and nobody else is there.
"""

import asyncio
import time
from collections.abc import Callable, Iterable

from sim_backend.crazyflie.faults import DatagramFaults
from sim_backend.crazyflie.server import CrazyflieServer
from sim_backend.pace import Pace
from sim_backend.room.driven_feed import DrivenFeed
from sim_backend.room.settings import RoomSettings
from sim_backend.turns import TurnsServer
from sim_backend.world import World

STEP_TICKS = 2
TICKS_IN_ONE_GO = 50
STRANGER_S = 1.0
"""Real time for which a lab lives on after a packet of a client that takes no part."""
LEAVING_S = 5.0
"""Lab time that somebody who leaves waits at most for the world to come to rest."""
_CATCH_UP_S = 0.05


class LabTraffic:
    """The packets of a lab, by the sockets of its clients; see :class:`sim_backend.turns.Traffic`.

    Args:
        servers: of the drones.
        links: what goes wrong on their links.
        delayed: packets take time on every link.

    Attributes:
        feed: of the lab's room, when it has one that lives in the lab's time.
    """

    def __init__(
        self, servers: list[CrazyflieServer], links: list[DatagramFaults], delayed: bool = False
    ) -> None:
        self.feed: DrivenFeed | None = None
        self._servers = servers
        self._links = links
        self._delayed = delayed
        self._known: set[int] = set()

    def belongs_to_participant(self, key: str) -> None:
        """A socket that is no stranger's, from here on."""
        kind, _, port = key.partition(":")
        if kind == "udp":
            self._known.add(int(port))

    def sent(self, key: str) -> int:
        """Packets to a socket."""
        kind, _, port = key.partition(":")
        if kind == "udp":
            return sum(server.sent[int(port)] for server in self._servers)
        return 0 if self.feed is None else self.feed.sent.get(key, 0)

    def received(self, key: str) -> int:
        """Packets from a socket; what goes to the room is not counted, no time hangs on it."""
        kind, _, port = key.partition(":")
        return sum(server.received[int(port)] for server in self._servers) if kind == "udp" else 0

    @property
    def faulty(self) -> bool:
        """Whether a link loses or delays packets."""
        return self._delayed or any(link.at_work for link in self._links)

    @property
    def in_callback(self) -> bool:
        """Whether a drone is in a parameter's callback."""
        return any(server.in_callback for server in self._servers)

    def is_stranger(self, port: int) -> bool:
        """Whether this socket is of a client that never took part."""
        return port not in self._known

    def of_strangers(self) -> int:
        """Packets that came from clients that never took part."""
        return sum(
            count for server in self._servers for port, count in server.received.items()
            if self.is_stranger(port)
        )  # fmt: skip


class LockStep:
    """Lets a world live in turns with those who take part.

    Args:
        world, servers, traffic, turns: of the lab.
        talk: lets the drones send what has become due, at this time.
        room: settings of its room; None without one.
        pace: how fast at most.
    """

    def __init__(
        self,
        world: World,
        servers: list[CrazyflieServer],
        traffic: LabTraffic,
        turns: TurnsServer,
        talk: Callable[[float], None],
        room: RoomSettings | None,
        pace: Pace,
    ) -> None:
        self._world = world
        self._servers = servers
        self._traffic = traffic
        self._turns = turns
        self._talk = talk
        self._room = room
        self._pace = pace
        self._frames = -1
        self._throttle = _Throttle()
        self._strangers = (0, -STRANGER_S)
        self._leaving_since: float | None = None

    async def run(self, stop: asyncio.Event) -> None:
        """Live until `stop` is set.

        Raises:
            TurnsError, RoomError: somebody who takes part is alive and silent for 60 s.
        """
        while not stop.is_set():
            while await self._turns.take(self._world.time):
                pass
            self._turns.connections_made(self._world.time)
            self._let_leave()
            if self._stands_still():
                await self._until_something_happens(stop)
            else:
                await self._go_on(stop)

    async def _go_on(self, stop: asyncio.Event) -> None:
        """Step until somebody has a turn; where nothing limits the rate, for 50 ms of the world at most."""
        rate = self._rate()
        for _ in range(TICKS_IN_ONE_GO // STEP_TICKS if rate is None else 1):
            for _ in range(STEP_TICKS):
                self._world.step()
            now = self._world.time
            self._talk(now)
            await self._show_to_room(now)
            if self._turns.has_news(now) or stop.is_set():
                break
        # Also without a limit: packets and messages that have come in the meantime get their turn.
        await self._throttle.keep(self._world.time, rate)

    async def _show_to_room(self, now: float) -> None:
        feed, settings = self._traffic.feed, self._room
        if feed is None or settings is None:
            return
        frames = int((now - settings.latency) / settings.period + 1e-6)
        due = frames > self._frames or settings.faults.jitter > 0.0
        self._frames = frames
        feed.send(now, self._world.seen(), answer=due)
        if due:
            await feed.dealt_with(now)

    def _rate(self) -> float | None:
        """Lab s in a real s at most, now."""
        rate = self._pace.rate
        if self._turns.participants:
            connecting = any(participant.connecting for participant in self._turns.participants)
            return min(1.0, rate or 1.0) if connecting else rate
        return 1.0 if rate is None and self._stranger_talks() else rate

    def _stranger_talks(self) -> bool:
        count, now = self._traffic.of_strangers(), time.monotonic()
        if count != self._strangers[0]:
            self._strangers = (count, now)
        return now - self._strangers[1] < STRANGER_S

    def _stands_still(self) -> bool:
        """Also where a factor limits the pace: how long a lab has waited for its first flight is no lab time,
        or the same seed would give another flight."""
        if self._turns.participants:
            return False
        return self._at_rest() and not self._stranger_talks()

    def _at_rest(self) -> bool:
        """Nothing moves, and nothing is about to happen by itself: no watchdog is about to bite."""
        return all(
            drone.at_rest and not drone.firmware.supervisor.watchdog_runs for drone in self._world.drones
        )

    def _let_leave(self) -> None:
        """Those who leave may go when the world is at rest, or does not come to rest."""
        if not self._turns.leaving:
            self._leaving_since = None
            return
        now = self._world.time
        self._leaving_since = now if self._leaving_since is None else self._leaving_since
        if self._turns.participants or self._at_rest() or now - self._leaving_since > LEAVING_S:
            self._turns.release()

    async def _until_something_happens(self, stop: asyncio.Event) -> None:
        waits: Iterable[asyncio.Task[bool]] = [
            asyncio.create_task(event.wait())
            for event in (stop, self._turns.changed, *(server.heard for server in self._servers))
        ]
        await asyncio.wait(waits, return_when=asyncio.FIRST_COMPLETED)
        for wait in waits:
            wait.cancel()
        self._turns.changed.clear()
        for server in self._servers:
            server.heard.clear()


class _Throttle:
    """Keeps a rate of lab time over real time, without making up for what was lost."""

    def __init__(self) -> None:
        self._rate: float | None = None
        self._lab_time = self._real_time = 0.0

    async def keep(self, lab_time: float, rate: float | None) -> None:
        """Wait until `lab_time` may be."""
        now = time.monotonic()
        if rate is None:
            self._rate = None
            await asyncio.sleep(0.0)
            return
        ahead = (lab_time - self._lab_time) / rate - (now - self._real_time)
        if rate != self._rate or ahead < -_CATCH_UP_S:
            self._rate, self._lab_time, self._real_time, ahead = rate, lab_time, now, 0.0
        await asyncio.sleep(max(0.0, ahead))
