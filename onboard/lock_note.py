"""What a locked file says of the process that holds it: its number, what for, and its command line."""

import contextlib
import os
import shlex
import sys
from datetime import datetime
from pathlib import Path

_NOTE_MAX = 300


def write_note(file: int, what: str) -> None:
    """Note this process in its locked `file`, and `what` it holds (one word)."""
    with contextlib.suppress(OSError):  # a full disk: it is locked all the same
        os.truncate(file, 0)
        os.pwrite(file, f"{os.getpid()} {what} {_command()}".encode(errors="replace")[:_NOTE_MAX], 0)


def holder(path: Path) -> str:
    """Who holds the lock and since when, from its file, in words."""
    try:
        (process, _, command), since = read_note(path), path.stat().st_mtime
    except OSError:  # just given back
        return "another process"
    return f"process {process} ({command}) since {datetime.fromtimestamp(since):%Y-%m-%d %H:%M:%S}"


def read_note(path: Path) -> tuple[int, str, str]:
    """Process, what it holds, and command line of whoever holds the lock of this file.

    Raises:
        OSError: the file cannot be read, or does not say.
    """
    note = path.read_text(errors="replace")[:_NOTE_MAX]
    process, what, command = [*"".join(c for c in note if c.isprintable()).split(" ", 2), "", ""][:3]
    if not process.isdecimal() or not what:
        raise OSError(f"{path} does not say who holds it")
    return int(process), what, command


def _command() -> str:
    """The command line of this process as a person would write it."""
    program, *arguments = sys.argv or [""]
    path = Path(program)
    name = path.parent.name if path.name == "__main__.py" else path.name
    return shlex.join([name, *arguments])
