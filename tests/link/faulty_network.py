"""A UDP proxy that loses, doubles, delays and reorders datagrams, freezes, or dies: a bad network between two
sockets."""

import heapq
import itertools
import selectors
import socket
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from onboard.closing import Closing


@dataclass(frozen=True)
class Faults:
    """Probabilities per datagram and direction; delays in s."""

    loss: float = 0.0
    duplicate: float = 0.0
    reorder: float = 0.0
    delay: float = 0.0
    downlink: float = 0.0
    """Beyond that, of the drone's packets alone."""
    jitter: float = 0.0
    """Longest delay beyond that, uniform from 0: packets overtake each other."""
    reorder_delay: float = 0.005


class FaultyNetwork(Closing):
    """Forwards between one client and ``target_port``; the client connects to ``uri``.

    Attributes:
        faults: what goes wrong now; may be exchanged at any time.
        withheld: whether a packet of the client never gets through.
        drop_replies: whether a packet of the drone never gets through.
        again_after: s after which a packet of the client comes a second time, or None.
        watch: told of every packet of the client, with the time at which it went on to the drone.
    """

    def __init__(self, target_port: int, rng: np.random.Generator, faults: Faults) -> None:
        self.faults = faults
        self.withheld: Callable[[bytes], bool] = lambda _packet: False
        self.drop_replies: Callable[[bytes], bool] = lambda _packet: False
        self.again_after: Callable[[bytes], float | None] = lambda _packet: None
        self.watch: Callable[[bytes, float], None] = lambda _packet, _time: None
        self.forwarded = self.lost = self.doubled = self.reordered = 0
        self.frozen = threading.Event()
        self._rng = rng
        self._front = _bound()
        self._back = _bound()
        self._back.connect(("127.0.0.1", target_port))
        self._client: tuple[str, int] | None = None
        self._pending: list[tuple[float, int, bool, bytes]] = []
        self._order = itertools.count()
        self._closing = threading.Event()
        self._thread = threading.Thread(target=self._run, name="FaultyNetwork")
        self._thread.start()

    @property
    def uri(self) -> str:
        """Address for the client."""
        return f"udp://127.0.0.1:{self._front.getsockname()[1]}"

    def die(self) -> None:
        """Vanish: the client's packets are refused from now on."""
        self.close()

    def close(self) -> None:
        """Stop and free the ports; idempotent."""
        self._closing.set()
        self._thread.join()
        self._front.close()
        self._back.close()

    def _run(self) -> None:
        with selectors.DefaultSelector() as selector:
            selector.register(self._front, selectors.EVENT_READ, True)
            selector.register(self._back, selectors.EVENT_READ, False)
            while not self._closing.is_set():
                wait = self._pending[0][0] - time.monotonic() if self._pending else 0.02
                for key, _ in selector.select(min(max(wait, 0.0), 0.02)):
                    self._receive(bool(key.data))
                self._send_due()

    def _receive(self, from_client: bool) -> None:
        try:
            if from_client:
                data, self._client = self._front.recvfrom(64)
            else:
                data = self._back.recv(64)
        except (BlockingIOError, ConnectionRefusedError):
            return
        withheld = self.withheld if from_client else self.drop_replies
        if self.frozen.is_set() or withheld(data):
            return
        if self._rng.random() < self.faults.loss:
            self.lost += 1
            return
        self._schedule(from_client, data)
        if self._rng.random() < self.faults.duplicate:
            self.doubled += 1
            self._schedule(from_client, data)
        again = self.again_after(data) if from_client else None
        if again is not None:
            self.doubled += 1
            self._schedule(from_client, data, again)

    def _schedule(self, from_client: bool, data: bytes, later: float = 0.0) -> None:
        later += self.faults.delay + (0.0 if from_client else self.faults.downlink)
        due = time.monotonic() + later + self._rng.uniform(0.0, self.faults.jitter)
        if self._rng.random() < self.faults.reorder:
            self.reordered += 1
            due += self.faults.reorder_delay
        heapq.heappush(self._pending, (due, next(self._order), from_client, data))

    def _send_due(self) -> None:
        while self._pending and self._pending[0][0] <= time.monotonic():
            _, _, from_client, data = heapq.heappop(self._pending)
            self.forwarded += 1
            try:
                if from_client:
                    self._back.send(data)
                    self.watch(data, time.monotonic())
                elif self._client is not None:
                    self._front.sendto(data, self._client)
            except ConnectionRefusedError:
                self.lost += 1


def _bound() -> socket.socket:
    bound = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    bound.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 1 << 20)
    bound.bind(("127.0.0.1", 0))
    bound.setblocking(False)
    return bound
