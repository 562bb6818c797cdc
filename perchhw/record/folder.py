"""Names of run folders and files that are replaced as a whole."""

import json
import os
import re
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

RUN_FILE = "run.json"
SERIES_FILE = "series.mcap"
EVENTS_FILE = "events.jsonl"


def utc_now() -> datetime:
    """Wall time, for names of folders and ``run.json`` only; nothing is computed from it."""
    return datetime.now(UTC)


def slug(text: str) -> str:
    """`text` as part of a file name: lower case letters, digits, ``.`` and ``-``."""
    return re.sub(r"[^a-z0-9.]+", "-", text.lower()).strip("-.") or "run"


def new_run_folder(parent: Path, name: str) -> Path:
    """A free path ``parent/<utc>-<slug>``; the folder itself is made by the recorder.

    Two runs within one second get different names.
    """
    stem = f"{utc_now():%Y%m%dT%H%M%SZ}-{slug(name)}"
    path = parent / stem
    number = 2
    while path.exists():
        path = parent / f"{stem}-{number}"
        number += 1
    return path


def write_json_atomically(path: Path, document: dict[str, Any]) -> None:
    """Replace `path` in one step: a reader sees the old document or the new one, never half of either."""
    temporary = path.with_name(f".{path.name}.{os.getpid()}")
    with temporary.open("w", encoding="utf-8") as stream:
        json.dump(document, stream, indent=2, allow_nan=False)
        stream.write("\n")
        stream.flush()
        os.fsync(stream.fileno())
    temporary.replace(path)
