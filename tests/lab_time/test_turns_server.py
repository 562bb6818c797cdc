"""The lab's side of its turns: time goes on past nobody who joins, and past nothing that was sent."""

import asyncio
from collections.abc import Awaitable, Callable
from typing import Any

import pytest

from onboard.lab_time.messages import decode, encode
from sim_backend import turns
from sim_backend.turns import TurnsServer


class CountedPackets:
    """What a lab has received from each socket; nothing is sent."""

    faulty = False
    in_callback = False

    def __init__(self) -> None:
        self.by_socket: dict[str, int] = {}

    def belongs_to_participant(self, key: str) -> None:
        """Nobody asks for strangers here."""

    def sent(self, key: str) -> int:
        return 0

    def received(self, key: str) -> int:
        return self.by_socket.get(key, 0)


class Peer:
    """A process that takes part, by hand."""

    def __init__(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        self._reader, self._writer = reader, writer

    def say(self, **message: Any) -> None:
        self._writer.write(encode(message))

    async def hear(self) -> dict[str, Any]:
        return decode(await asyncio.wait_for(self._reader.readline(), 60.0))

    async def ask(self, what: str, **details: Any) -> dict[str, Any]:
        self.say(ask=what, **details)
        return await self.hear()

    def close(self) -> None:
        self._writer.close()


def with_a_peer(scene: Callable[[TurnsServer, CountedPackets, Peer], Awaitable[None]]) -> None:
    """Play a scene of a lab and one process that has joined it."""

    async def play() -> None:
        packets = CountedPackets()
        server = TurnsServer(packets, now=lambda: 0.0, figures=dict)
        await server.start("127.0.0.1")
        peer = Peer(*await asyncio.open_connection("127.0.0.1", server.port))
        try:
            await peer.ask("join", name="peer")
            await scene(server, packets, peer)
        finally:
            peer.close()
            await server.close()

    asyncio.run(play())


def test_nobody_can_join_between_the_question_who_is_due_and_its_answer() -> None:
    nobody = TurnsServer(CountedPackets(), now=lambda: 0.0, figures=dict).take(0.0)
    with pytest.raises(StopIteration) as answer:  # at once: the loop runs nothing else meanwhile
        nobody.send(None)
    assert answer.value.value is False


@pytest.mark.parametrize("leaves", [False, True])
def test_what_a_closed_socket_sent_has_arrived_before_time_goes_on(leaves: bool) -> None:
    async def scene(server: TurnsServer, packets: CountedPackets, peer: Peer) -> None:
        await peer.ask("open", key="udp:1")
        turn = asyncio.create_task(server.take(0.0))
        assert (await peer.hear())["t"] == 0.0
        peer.say(close="udp:1", packets=2)
        if leaves:
            peer.say(ask="leave")
        else:
            peer.say(done=0.0, next=None, packets={})
        packets.by_socket["udp:1"] = 1
        assert (await peer.ask("status"))["answer"] == "status"  # all of this was heard
        for _ in range(20):
            await asyncio.sleep(0.0)
        assert not turn.done()
        packets.by_socket["udp:1"] = 2
        assert await asyncio.wait_for(turn, 60.0)

    with_a_peer(scene)


def test_a_socket_that_talked_to_somebody_else_is_not_waited_for() -> None:
    async def scene(server: TurnsServer, packets: CountedPackets, peer: Peer) -> None:
        await peer.ask("open", key="udp:1")
        turn = asyncio.create_task(server.take(0.0))
        await peer.hear()
        peer.say(close="udp:1", packets=2)
        peer.say(done=0.0, next=None, packets={})
        assert await asyncio.wait_for(turn, 60.0)

    with_a_peer(scene)


def test_packets_that_never_arrive_end_the_lab_with_the_reason(monkeypatch: pytest.MonkeyPatch) -> None:
    async def scene(server: TurnsServer, packets: CountedPackets, peer: Peer) -> None:
        await peer.ask("open", key="udp:1")
        turn = asyncio.create_task(server.take(0.0))
        await peer.hear()
        peer.say(done=0.0, next=None, packets={"udp:1": 1})
        monkeypatch.setattr(turns, "SILENCE_LIMIT_S", 0.01)  # read once the turn is over
        with pytest.raises(turns.TurnsError, match=r"peer has sent packets that did not arrive"):
            await asyncio.wait_for(turn, 60.0)

    with_a_peer(scene)


def test_who_connects_is_told_to_wait_for_a_drone_that_is_not_done_with_what_was_sent() -> None:
    async def scene(server: TurnsServer, packets: CountedPackets, peer: Peer) -> None:
        await peer.ask("open", key="udp:1")
        assert (await peer.ask("connecting"))["wait"] is False
        packets.in_callback = True
        assert (await peer.ask("connecting"))["wait"] is True
        packets.in_callback = False
        packets.by_socket["udp:1"] = 1
        peer.say(close="udp:1", packets=2)
        assert (await peer.ask("connecting"))["wait"] is True
        packets.by_socket["udp:1"] = 2
        assert (await peer.ask("connecting"))["wait"] is False
        packets.in_callback = packets.faulty = True  # such a lab goes on by itself meanwhile
        assert await peer.ask("connecting") == {"answer": "connecting", "runs": True, "wait": False}

    with_a_peer(scene)
