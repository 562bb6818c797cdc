"""Who is told by MAVLink, in tests: MAVSDK as a child process, and pymavlink of the other dialect."""

import importlib.util
import json
import queue
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import pytest
from pymavlink.dialects.v20 import ardupilotmega

PATIENCE_S = 60.0

needs_mavsdk = pytest.mark.skipif(
    importlib.util.find_spec("mavsdk") is None, reason="mavsdk is not installed: pip install mavsdk"
)


def free_port() -> int:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


class MavsdkGround:
    """The child process ``mavsdk_ground.py``; what it was told so far is in `told`."""

    def __init__(self) -> None:
        self.port = free_port()
        self.told: list[dict[str, Any]] = []
        self._lines: queue.Queue[dict[str, Any]] = queue.Queue()

    def __enter__(self) -> Self:
        script = Path(__file__).with_name("mavsdk_ground.py")
        self._process = subprocess.Popen(
            [sys.executable, str(script), str(self.port)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            text=True,
        )
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()
        self.until("listening")
        return self

    def _read(self) -> None:
        assert self._process.stdout is not None
        for line in self._process.stdout:
            if line.startswith("{"):  # its library prints there as well
                self._lines.put(json.loads(line))

    def until(self, kind: str, where: Callable[[dict[str, Any]], bool] = lambda line: True) -> dict[str, Any]:
        """The first line of this kind from now on for which `where` holds."""
        deadline = time.monotonic() + PATIENCE_S
        while (remaining := deadline - time.monotonic()) > 0.0:
            try:
                line = self._lines.get(timeout=remaining)
            except queue.Empty:
                break
            self.told.append(line)
            if line["kind"] == kind and where(line):
                return line
        raise AssertionError(f"MAVSDK told no such {kind}; it told {self.told[-5:]}")

    def ask(self, line: str) -> None:
        assert self._process.stdin is not None
        self._process.stdin.write(line + "\n")
        self._process.stdin.flush()

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._process.kill()
        self._process.wait()
        self._reader.join()
        self._process.stdin.close()
        self._process.stdout.close()


class Listener:
    """A UDP socket with ArduPilot's dialect of MAVLink 2; loses packets when it is told to."""

    def __init__(self, key: bytes | None = None, keep: Callable[[], bool] = lambda: True) -> None:
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.socket.bind(("127.0.0.1", 0))
        self.port = int(self.socket.getsockname()[1])
        self.codec = ardupilotmega.MAVLink(None, srcSystem=255, srcComponent=190)
        self.codec.robust_parsing = True
        if key is not None:
            self.codec.signing.secret_key = key
            self.codec.signing.sign_outgoing = True
            self.codec.signing.timestamp = 1
        self._keep = keep
        self.source: Any = None

    def messages(self, seconds: float = PATIENCE_S) -> Iterator[Any]:
        deadline = time.monotonic() + seconds
        while (remaining := deadline - time.monotonic()) > 0.0:
            self.socket.settimeout(remaining)
            try:
                data, self.source = self.socket.recvfrom(2048)
            except TimeoutError:
                return
            if self._keep():
                yield from self.codec.parse_buffer(data) or ()

    def until(self, kind: str, where: Callable[[Any], bool] = lambda message: True) -> Any:
        for message in self.messages():
            if message.get_type() == kind and where(message):
                return message
        raise AssertionError(f"no such {kind} came")

    def send(self, message: Any) -> None:
        self.socket.sendto(message.pack(self.codec), self.source)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.socket.close()
