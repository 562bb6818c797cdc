"""MAVProxy as a ground station: a child process whose console is asked by its own commands."""

import os
import queue
import re
import subprocess
import sys
import threading
import time
from pathlib import Path
from types import TracebackType
from typing import Self

import pytest

from tests.mavlink.ground import free_port
from tests.patience import PATIENCE_S

PROGRAM = Path(sys.executable).with_name("mavproxy.py")

needs_mavproxy = pytest.mark.skipif(
    not PROGRAM.is_file(), reason="MAVProxy is not installed beside this Python: pip install MAVProxy"
)


class MavproxyGround:
    """Listens on `port` of this computer; what its console said is in `said`."""

    def __init__(self, folder: Path) -> None:
        self.port = free_port()
        self.said: list[str] = []
        self._folder = folder
        self._lines: queue.Queue[str] = queue.Queue()

    def __enter__(self) -> Self:
        self._process = subprocess.Popen(
            [
                *(sys.executable, str(PROGRAM), f"--master=udpin:127.0.0.1:{self.port}"),
                *(
                    "--default-modules=arm",
                    f"--state-basedir={self._folder}",
                    f"--logfile={self._folder}/tlog",
                ),
            ],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            env={**os.environ, "PYTHONUNBUFFERED": "1"},
            cwd=self._folder,
            text=True,
        )
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()
        self.until("Waiting for heartbeat")  # what is said once must not come before it listens
        return self

    def _read(self) -> None:
        assert self._process.stdout is not None
        for line in self._process.stdout:
            self._lines.put(line.rstrip())

    def ask(self, command: str) -> None:
        """Type a command."""
        assert self._process.stdin is not None
        self._process.stdin.write(command + "\n")
        self._process.stdin.flush()

    def until(self, pattern: str, asking: str | None = None) -> re.Match[str]:
        """The first line from now on in which `pattern` is found; `asking` is typed every second."""
        deadline = time.monotonic() + PATIENCE_S
        while time.monotonic() < deadline:
            if asking is not None:
                self.ask(asking)
            try:
                while True:
                    line = self._lines.get(timeout=1.0)
                    self.said.append(line)
                    if found := re.search(pattern, line):
                        return found
            except queue.Empty:
                continue
        raise AssertionError(f"MAVProxy said nothing of {pattern!r}, but {self.said[-20:]}")

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._process.kill()
        self._process.wait()
        self._reader.join()
        for pipe in (self._process.stdin, self._process.stdout):
            assert pipe is not None
            pipe.close()
