"""The screen's process: ``python -m perchhw.screen SOCKET FLIGHT``, with the terminal as stdin and stdout.

It ends when the flight's process closes the socket, however that ended, and leaves the terminal as it was.
"""

import contextlib
import json
import os
import select
import signal
import socket
import sys
import threading

from rich.console import Console, Group
from rich.live import Live
from rich.text import Text

from perchhw.screen.keys import NOBODY, Keys
from perchhw.screen.layout import rows
from perchhw.screen.snapshot import Snapshot
from perchhw.screen.terminal import keys_of

_KEYBOARD = 0
_IGNORED = ("SIGINT", "SIGTERM", "SIGHUP", "SIGQUIT", "SIGTSTP", "SIGTTIN", "SIGTTOU", "SIGPIPE")
"""All of them are for the flight, which ends this process by ending."""


class Drawn:
    """Draws on the terminal, whenever there is something new."""

    def __init__(self, live: Live, console: Console) -> None:
        self._live, self._console = live, console
        self._plain = "utf" not in console.encoding.lower()
        self._shown: list[Text] | None = None
        self._alert: str | None = None

    def draw(self, snapshot: Snapshot, typed: str) -> None:
        """As rows; with a bell for a new alert."""
        width, height = self._console.size
        shown = rows(snapshot, typed, width, height, self._plain)
        if shown == self._shown:
            return
        self._shown = shown
        self._live.update(Group(*shown), refresh=True)
        if snapshot.alert not in (None, self._alert):
            self._console.bell()
        self._alert = snapshot.alert


def _read_keys(keys: Keys, changed: int) -> None:
    with contextlib.suppress(OSError):  # the terminal is gone
        while read := os.read(_KEYBOARD, 1024):
            keys.press(read)
            os.write(changed, b".")
    keys.send({"key": NOBODY})


def _lines(connection: socket.socket, unread: bytearray) -> list[bytes] | None:
    """Whole lines that have come, or None at the end."""
    read = connection.recv(1 << 16)
    if not read:
        return None
    unread += read
    *whole, rest = bytes(unread).split(b"\n")
    unread[:] = rest
    return whole


def show(connection: socket.socket, flight: int) -> None:
    """Show what comes, until nothing can come any more."""

    def send(message: dict[str, object]) -> None:
        with contextlib.suppress(OSError):  # the flight has ended; so does this process
            connection.sendall(json.dumps(message).encode() + b"\n")

    keys, unread = Keys(flight, send), bytearray()
    changed, tell = os.pipe()
    threading.Thread(target=_read_keys, args=(keys, tell), daemon=True).start()
    console = Console(highlight=False)
    with Live(console=console, screen=True, auto_refresh=False) as live:
        drawn = Drawn(live, console)
        while True:
            ready, _, _ = select.select([connection.fileno(), changed], [], [], 1.0)
            if changed in ready:
                os.read(changed, 1024)
            if connection.fileno() in ready:
                lines = _lines(connection, unread)
                if lines is None:
                    return
                if lines:
                    keys.snapshot = Snapshot.from_line(lines[-1])
            drawn.draw(keys.snapshot, keys.typed)


def main() -> None:
    """Until the flight's process closes the socket."""
    for name in _IGNORED:
        if hasattr(signal, name):
            signal.signal(getattr(signal, name), signal.SIG_IGN)
    signal.pthread_sigmask(signal.SIG_SETMASK, ())
    with socket.socket(fileno=int(sys.argv[1])) as connection, keys_of(_KEYBOARD):
        show(connection, int(sys.argv[2]))


if __name__ == "__main__":
    main()
