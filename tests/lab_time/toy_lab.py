"""A lab's clock without a lab: a test says what time it is and how many packets are under way."""

import contextlib
import queue
import socket
import threading
from types import TracebackType
from typing import Any, Self

from onboard.lab_time.messages import decode, encode


class ToyLab:
    """Answers one participant; a context manager."""

    def __init__(self) -> None:
        self._listener = socket.create_server(("127.0.0.1", 0))
        self.port = self._listener.getsockname()[1]
        self.done: queue.Queue[dict[str, Any]] = queue.Queue()
        self.asked: list[str] = []
        self._peer: socket.socket | None = None
        self._thread = threading.Thread(target=self._serve, daemon=True)

    def turn(self, t: float, packets: dict[str, int] | None = None) -> dict[str, Any]:
        """A whole turn: what the participant says at its end."""
        self.begin_turn(t, packets)
        return self.done.get(timeout=120.0)

    def begin_turn(self, t: float, packets: dict[str, int] | None = None) -> None:
        """Say what time it is."""
        self._say({"t": t, "packets": packets or {}})

    def die(self) -> None:
        """End without a word."""
        assert self._peer is not None
        self._peer.shutdown(socket.SHUT_RDWR)

    def _say(self, message: dict[str, Any]) -> None:
        assert self._peer is not None
        self._peer.sendall(encode(message))

    def _serve(self) -> None:
        with contextlib.suppress(OSError):  # closed by the test
            self._peer, _ = self._listener.accept()
            self._hear(self._peer)

    def _hear(self, peer: socket.socket) -> None:
        with peer.makefile("rb") as lines:
            for line in lines:
                message = decode(line)
                if "done" in message:
                    self.done.put(message)
                elif "ask" in message:
                    self.asked.append(message["ask"])
                    self._say({"answer": message["ask"], "t": 0.0, "packets": 0, "runs": False})

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._listener.close()
        if self._peer is not None:
            self._peer.close()
