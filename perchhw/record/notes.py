"""Notes of the operator, put into a record while it is written or after it was closed."""

import json
import os
from pathlib import Path

from onboard.record.checksum import with_checksum
from onboard.record.run_record import EVENTS_FILE


def add_note(folder: Path, t: float, text: str, phase: str | None = None) -> None:
    """Append an event ``note``: one write to the end of the file, which no other writer's line can tear.

    Args:
        folder: a run folder.
        t: when what is noted was seen, s of the record's clock.
        text: the operator's words; empty for a moment that is only marked.
        phase: in which it was seen.

    Raises:
        OSError: the folder holds no record, or its disk is full.
    """
    line = json.dumps(with_checksum({"t": t, "event": "note", "phase": phase, "text": text})) + "\n"
    descriptor = os.open(folder / EVENTS_FILE, os.O_WRONLY | os.O_APPEND)
    try:
        os.write(descriptor, line.encode())
    finally:
        os.close(descriptor)
