"""Tables of contents that this user's processes have read before, by their checksum on the drone.

A file a table, JSON, written beside its place and then moved there, so that no process reads half of one. A
file that cannot be used (damaged, of another format, of another length than the drone says) counts as not
there: the table is read from the drone and the file written again. Names in it choose what is written to a
drone, so the folder must be this user's alone, else it is left unused.
"""

import contextlib
import json
import logging
import os
import stat
import tempfile
import zlib
from pathlib import Path

from onboard.user_cache import user_cache

SCHEMA = "perchhw.toc/1"
Rows = list[tuple[int, str]]
"""Type byte and complete name of each variable, in the order of the ids."""
_log = logging.getLogger(__name__)


class TableCache:
    """The folder of tables.

    Args:
        folder: where; this user's cache by default.
    """

    def __init__(self, folder: Path | None = None) -> None:
        self._folder = user_cache() / "tables" if folder is None else folder

    def fetch(self, kind: str, checksum: int, length: int) -> Rows | None:
        """A table of so many rows that was kept, or None."""
        if not self._usable():
            return None
        try:
            text = self._file(kind, checksum).read_text("utf-8")
        except (OSError, UnicodeDecodeError):
            return None
        rows = _decode(text)
        return rows if rows is not None and len(rows) == length else None

    def keep(self, kind: str, checksum: int, rows: Rows) -> None:
        """Keep a table; where that is not possible, the next connection reads it again."""
        try:
            self._folder.mkdir(parents=True, exist_ok=True, mode=0o700)
        except OSError as error:
            _log.info("tables of the drone are not kept: %s", error)
            return
        if self._usable():
            with contextlib.suppress(OSError):  # a full disk, or one that only reads
                _write(self._file(kind, checksum), _encode(rows))

    def _file(self, kind: str, checksum: int) -> Path:
        return self._folder / f"{kind}-{checksum:08X}.json"

    def _usable(self) -> bool:
        """Whether the folder is there, and nobody else writes to it."""
        try:
            about = self._folder.lstat()
        except OSError:
            return False
        if os.name == "nt":
            return True
        private = about.st_uid == os.getuid() and not about.st_mode & (stat.S_IWGRP | stat.S_IWOTH)
        if not private or not stat.S_ISDIR(about.st_mode):
            _log.warning(
                "%s is not this user's alone, and is not used: chmod 700 it, or remove it",
                self._folder,
            )
            return False
        return True


def _encode(rows: Rows) -> str:
    table = json.dumps(rows)
    return json.dumps({"schema": SCHEMA, "crc32": zlib.crc32(table.encode()), "rows": rows})


def _decode(text: str) -> Rows | None:
    """The rows, or None when a byte of them is not what was written."""
    try:
        kept = json.loads(text)
        if kept["schema"] != SCHEMA or kept["crc32"] != zlib.crc32(json.dumps(kept["rows"]).encode()):
            return None
        return [(int(code), str(name)) for code, name in kept["rows"]]
    except (ValueError, KeyError, TypeError, RecursionError):
        return None


def _write(file: Path, text: str) -> None:
    """Write the whole file or nothing of it."""
    descriptor, name = tempfile.mkstemp(dir=file.parent, prefix=file.name)
    try:
        with os.fdopen(descriptor, "w", encoding="utf-8") as beside:
            beside.write(text)
        Path(name).replace(file)
    except OSError:
        with contextlib.suppress(OSError):
            Path(name).unlink()
        raise
