"""Those who take part in a lab's time: the server of its clock (:mod:`onboard.lab_time.messages`).

A turn is given to a participant when packets were sent to it, or when the time has come that it waits for. It
is over when the participant says so and everything that it sent has arrived.
"""

import asyncio
import logging
import socket
from collections.abc import Callable
from typing import Any, Protocol

from onboard.lab_time.messages import Message, decode, encode
from sim_backend.errors import SimulationError

SILENCE_LIMIT_S = 60.0
"""Real time within which a turn must be over."""


_log = logging.getLogger(__name__)


class TurnsError(SimulationError):
    """Somebody who takes part in the lab's time is alive and does not answer."""


class Traffic(Protocol):
    """The packets of a lab, counted by the sockets of its clients."""

    def belongs_to_participant(self, key: str) -> None:
        """This socket is of somebody who takes part: no stranger's."""

    def sent(self, key: str) -> int:
        """Packets that were sent to this socket so far."""

    def received(self, key: str) -> int:
        """Packets that came from this socket so far."""

    @property
    def faulty(self) -> bool:
        """Whether links lose or delay packets: then a connection needs time to go on."""

    @property
    def in_callback(self) -> bool:
        """Whether a drone is in a parameter's callback, which answers none, and ends when time goes on."""


class Participant:
    """One process that takes part.

    Attributes:
        name: what it calls itself.
        connecting: it must not be waited for.
        gone: it takes part no more.
    """

    def __init__(self, writer: asyncio.StreamWriter) -> None:
        self.name = "?"
        self.connecting = False
        self.gone = False
        self._writer = writer
        self._sockets: dict[str, int] = {}
        self._told: dict[str, int] = {}
        self._sent: dict[str, int] = {}
        self._due_from_closed: dict[str, int] = {}
        self._next: float | None = 0.0
        self._running = 0
        self._connected_at: float | None = None
        self._changed = asyncio.Event()

    def has_news(self, now: float, traffic: Traffic) -> bool:
        """Whether a turn is due."""
        if self._next is not None and self._next <= now:
            return True
        return any(traffic.sent(key) != self._told.get(key) for key in self._sockets)

    def begin_turn(self, now: float, traffic: Traffic) -> None:
        """Tell the time, and how many packets are on their way."""
        self._told = {key: traffic.sent(key) for key in self._sockets}
        self._running += 1
        self._next = None
        self.send({"t": now, "packets": self._told})

    def arrived(self, traffic: Traffic) -> bool:
        """Whether all that it sent is here, also from sockets that it has closed."""
        due = {key: before + self._sent.get(key, 0) for key, before in self._sockets.items()}
        return all(traffic.received(key) >= count for key, count in (self._due_from_closed | due).items())

    async def finish_turn(self) -> None:
        """Wait until its turns are over, or it connects, or is gone.

        Raises:
            TurnsError: it is silent for 60 s.
        """
        while self._running > 0 and not self.connecting and not self.gone:
            self._changed.clear()
            try:
                async with asyncio.timeout(SILENCE_LIMIT_S):
                    await self._changed.wait()
            except TimeoutError:
                raise TurnsError(
                    f"{self.name} takes part in the lab's time and has said nothing for "
                    f"{SILENCE_LIMIT_S:g} s; it hangs, or is stopped: end it and start the lab again"
                ) from None

    def take(self, message: Message, now: float, traffic: Traffic) -> None:
        """What it says while it takes part."""
        if "done" in message:
            self._running -= 1
            self._next = message["next"]
            self._sent = message["packets"]
        elif "close" in message:
            self._forget(str(message["close"]), message["packets"], traffic)
        match message.get("ask"):
            case "join":
                self.name = str(message.get("name", "?"))
                self.answer("join", t=now)
            case "open":
                key = str(message["key"])
                traffic.belongs_to_participant(key)
                self._due_from_closed.pop(key, None)
                self._sockets[key] = traffic.received(key)
                self._told[key] = traffic.sent(key)
                self.answer("open", packets=traffic.sent(key))
            case "connecting":
                self.connecting = traffic.faulty
                wait = traffic.in_callback or not self.arrived(traffic)
                self.answer("connecting", runs=self.connecting, wait=wait and not self.connecting)
            case "connected":
                self._connected_at = float(message["t"])
        self.wake()

    def _forget(self, key: str, packets: int, traffic: Traffic) -> None:
        """It has closed a socket from which it sent so much in all: to this lab, when anything was heard."""
        before = self._sockets.pop(key, None)
        if before is not None and traffic.received(key) > before:
            self._due_from_closed[key] = before + packets

    def connection_made(self, now: float) -> None:
        """It has connected, by its own clock, and the lab has come so far: it is waited for again."""
        if self._connected_at is not None and self._connected_at <= now:
            self.connecting, self._connected_at = False, None
            self._next = now
            self.answer("connected", t=now)

    def wake(self) -> None:
        """Look again whether its turn is over."""
        self._changed.set()

    def answer(self, what: str, **details: Any) -> None:
        """Answer what it asked."""
        self.send({"answer": what, **details})

    def send(self, message: Message) -> None:
        """Send to it; one that is gone is noticed by who reads."""
        if not self._writer.is_closing():
            self._writer.write(encode(message))


class TurnsServer:
    """Serves the lab's clock on a TCP port.

    Attributes:
        participants: who takes part now.
        port: of the clock, from :meth:`start` on.
        changed: set when somebody comes, speaks or goes.
    """

    def __init__(self, traffic: Traffic, now: Callable[[], float], figures: Callable[[], Message]) -> None:
        self.participants: list[Participant] = []
        self.port = 0
        self.changed = asyncio.Event()
        self._traffic = traffic
        self._now = now
        self._figures = figures
        self._leaving: list[Participant] = []
        self._server: asyncio.Server | None = None

    async def start(self, host: str) -> None:
        """Listen on a free port."""
        self._server = await asyncio.start_server(self._serve, host, 0)
        self.port = self._server.sockets[0].getsockname()[1]

    async def close(self) -> None:
        """Stop listening, and let go of everybody."""
        if self._server is not None:
            self._server.close()
            for participant in (*self.participants, *self._leaving):
                participant._writer.close()
            self._server = None

    async def take(self, now: float) -> bool:
        """Give a turn to each for whom there is news; whether anybody had one.

        Raises:
            TurnsError: one is silent for 60 s, or what it has sent does not arrive for as long.
        """
        traffic = self._traffic
        due = [p for p in self.participants if not p.connecting and p.has_news(now, traffic)]
        if not due:
            return False  # without a pause, in which somebody could join unseen before time goes on
        for participant in due:
            participant.begin_turn(now, traffic)
        for participant in due:
            await participant.finish_turn()
        try:
            async with asyncio.timeout(SILENCE_LIMIT_S):
                await self._everything_arrives(due)
        except TimeoutError:
            late = ", ".join(p.name for p in due if not p.arrived(traffic))
            raise TurnsError(
                f"{late} has sent packets that did not arrive here in {SILENCE_LIMIT_S:g} s: does it talk to "
                "an address where no drone of this lab is? Start the lab again"
            ) from None
        return True

    async def _everything_arrives(self, participants: list[Participant]) -> None:
        for participant in participants:
            while not participant.arrived(self._traffic):
                await asyncio.sleep(0.0)

    def connections_made(self, now: float) -> None:
        """Wait again for those who have connected."""
        for participant in self.participants:
            participant.connection_made(now)

    def has_news(self, now: float) -> bool:
        """Whether :meth:`take` would give a turn."""
        return any(not p.connecting and p.has_news(now, self._traffic) for p in self.participants)

    def release(self) -> None:
        """The world is at rest: those who wanted to leave may."""
        for participant in self._leaving:
            participant.answer("leave")
        self._leaving.clear()

    @property
    def leaving(self) -> bool:
        """Whether somebody waits for the world to come to rest."""
        return bool(self._leaving)

    async def _serve(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        writer.get_extra_info("socket").setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        participant = Participant(writer)
        try:
            while line := await reader.readline():
                self._hear(participant, decode(line))
        except (ConnectionError, ValueError, KeyError) as error:
            _log.info("%s broke off, or is not one of ours: %s", participant.name, error)
        finally:
            participant.gone = True
            for group in (self.participants, self._leaving):
                if participant in group:
                    group.remove(participant)
            participant.wake()
            self.changed.set()
            writer.close()

    def _hear(self, participant: Participant, message: Message) -> None:
        asked = message.get("ask")
        if asked == "status":
            participant.answer("status", **self._figures())
        elif asked == "leave" and participant in self.participants:
            participant.gone = True
            self.participants.remove(participant)
            self._leaving.append(participant)
        else:
            if asked == "join":
                self.participants.append(participant)
            participant.take(message, self._now(), self._traffic)
        participant.wake()
        self.changed.set()
