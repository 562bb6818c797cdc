"""Text files that are replaced as a whole."""

import os
from pathlib import Path

_UNFIT = "backslashreplace"
"""What is no text, as bytes of a foreign encoding in a name that was typed, is written as its codes."""


def write_atomically(path: Path, text: str, room: Path | None = None) -> None:
    """Write `text` in one step: a reader sees the old file or the new one, whole.

    Args:
        path: of the file.
        text: its content.
        room: a file beside `path` that becomes it. Its bytes on the disk are used again, so that a text no
            longer than it needs no room of a full disk. None: a new file.
    """
    temporary = room or path.with_name(f".{path.name}.{os.getpid()}")
    try:
        with temporary.open("w" if room is None else "r+", encoding="utf-8", errors=_UNFIT) as stream:
            stream.write(text)
            stream.truncate()
            stream.flush()
            os.fsync(stream.fileno())
        temporary.replace(path)
    except BaseException:
        temporary.unlink(missing_ok=True)  # a full disk keeps no part of it
        raise
