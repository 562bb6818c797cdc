"""A command on a real pseudo-terminal, read by somebody else's terminal (pyte)."""

import fcntl
import os
import pty
import select
import shlex
import signal
import struct
import subprocess
import sys
import termios
import threading
import time
from collections.abc import Callable
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import pyte

from tests.patience import PATIENCE_S

_WITHIN_S = PATIENCE_S


class Terminal:
    """Runs a command of ours as somebody at a terminal does.

    Args:
        arguments: of ``python -m perchhw``, or with `module` of another module.
        columns, lines: size.
        environment: added to that of the command.
    """

    def __init__(
        self,
        *arguments: str,
        columns: int = 80,
        lines: int = 24,
        module: str = "perchhw",
        environment: dict[str, str] | None = None,
    ) -> None:
        self._ours, theirs = pty.openpty()
        fcntl.ioctl(theirs, termios.TIOCSWINSZ, struct.pack("HHHH", lines, columns, 0, 0))
        self.before = termios.tcgetattr(theirs)
        self._theirs = theirs
        self._screen = pyte.Screen(columns, lines)
        self._stream = pyte.ByteStream(self._screen)
        self._lock = threading.Lock()
        self._written_at = time.monotonic()
        self.raw = b""
        line = shlex.join([sys.executable, "-m", module, *arguments])
        # Who runs tests in parallel tells them the width of another terminal.
        inherited = {name: value for name, value in os.environ.items() if name not in ("COLUMNS", "LINES")}
        name = shlex.quote(os.ttyname(theirs))  # the first terminal that a session's leader opens is its own
        self.process = subprocess.Popen(
            ["sh", "-c", f"exec {line} <{name} >{name} 2>{name}"],
            start_new_session=True,
            env={**inherited, "TERM": "xterm-256color", "LANG": "C.UTF-8", **(environment or {})},
        )
        self._ended = False
        self._thread = threading.Thread(target=self._read, daemon=True)
        self._thread.start()

    def _read(self) -> None:
        while not self._ended:
            ready, _, _ = select.select([self._ours], [], [], 0.05)
            if not ready:
                continue
            read = os.read(self._ours, 1 << 16)
            with self._lock:
                self.raw += read
                self._written_at = time.monotonic()
                self._stream.feed(read)

    def shown(self) -> list[str]:
        """The rows as a person sees them now."""
        with self._lock:
            return [row.rstrip() for row in self._screen.display]

    def text(self) -> str:
        """All of them."""
        return "\n".join(self.shown())

    def until(self, text: str, within: float = _WITHIN_S) -> list[str]:
        """Wait until `text` is shown; the rows."""
        self.wait(lambda: text in self.text(), within, text)
        return self.shown()

    def wait(self, condition: Callable[[], Any], within: float = _WITHIN_S, what: str = "") -> None:
        """Wait for a condition."""
        deadline = time.monotonic() + within
        while not condition():
            assert time.monotonic() < deadline, f"waited for {what!r}; shown is\n{self.text()}"
            threading.Event().wait(0.01)

    def press(self, keys: str) -> float:
        """Press keys; when, on the monotonic clock (s)."""
        now = time.monotonic()
        os.write(self._ours, keys.encode())
        return now

    def silent_for(self, seconds: float) -> bool:
        """Nothing was written to it for so long (s)."""
        with self._lock:
            return time.monotonic() - self._written_at > seconds

    def restored(self) -> bool:
        """The settings are those of before, the cursor is seen, the alternate screen was left."""
        with self._lock:
            left = self.raw.count(b"\x1b[?1049h") <= self.raw.count(b"\x1b[?1049l")
            return left and not self._screen.cursor.hidden and self.before == termios.tcgetattr(self._theirs)

    def ended(self) -> int:
        """Wait for the end of the command; its exit code."""
        code = self.process.wait(_WITHIN_S)
        self.wait(self.restored, 5.0, "terminal as it was")
        return code

    def children(self) -> list[int]:
        """Process ids of the command's own children."""
        file = Path(f"/proc/{self.process.pid}/task/{self.process.pid}/children")
        return [int(pid) for pid in file.read_text().split()]

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self.process.poll() is None:
            self.process.send_signal(signal.SIGKILL)
            self.process.wait()
        self._ended = True
        self._thread.join()
        os.close(self._ours)
        os.close(self._theirs)
