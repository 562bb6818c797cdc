"""Run folders: their names, and making them."""

import itertools
import os
import re
from datetime import UTC, datetime
from pathlib import Path

from onboard.errors import InputError, OnboardError


class OutputFolderError(OnboardError, InputError):
    """A folder for results cannot be written; the message names it and the reason."""

    def __init__(self, folder: Path, reason: str | None, option: str = "--out") -> None:
        super().__init__(f"{folder}: cannot be written ({reason}); give a folder that can, with {option}")
        self.folder, self.reason = folder, reason


def utc_now() -> datetime:
    """Wall time, for names of folders and ``run.json`` only; nothing is computed from it."""
    return datetime.now(UTC)


def slug(text: str) -> str:
    """`text` as part of a file name: lower case letters, digits, ``.`` and ``-``."""
    return re.sub(r"[^a-z0-9.]+", "-", text.lower()).strip("-.") or "run"


def new_run_folder(parent: Path, name: str) -> Path:
    """Make and give a new, empty folder ``parent/<utc>-<slug>``.

    It is reserved by making it: two runs within one second, also of two processes, get different ones. Who
    does not write into it after all gives it back with :func:`discard_if_empty`.

    Raises:
        OutputFolderError: `parent` cannot be written.
    """
    make_folder(parent)
    stem = f"{utc_now():%Y%m%dT%H%M%SZ}-{slug(name)}"
    for number in itertools.count(1):
        path = parent / (stem if number == 1 else f"{stem}-{number}")
        try:
            path.mkdir()
        except FileExistsError:
            continue
        except OSError as error:
            raise OutputFolderError(parent, error.strerror) from error
        break
    return path


def make_folder(folder: Path) -> None:
    """Make `folder` and its parents, unless it is there already.

    Raises:
        OutputFolderError: it cannot be made or written.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise OutputFolderError(folder, error.strerror) from error
    if not os.access(folder, os.W_OK | os.X_OK):
        raise OutputFolderError(folder, "no permission to write into it")


def require_writable(folder: Path, option: str = "--out") -> None:
    """See that `folder` is there and can be written, or could be made; nothing is made. `option` named it.

    Raises:
        OutputFolderError: it can not.
    """
    there = next(path for path in (folder, *folder.absolute().parents) if path.exists())
    if not there.is_dir():
        raise OutputFolderError(folder, f"{there} is no folder", option)
    if not os.access(there, os.W_OK | os.X_OK):
        raise OutputFolderError(folder, f"no permission to write into {there}", option)


def discard_if_empty(folder: Path) -> None:
    """Remove a reserved folder into which nothing was written; one that holds something stays."""
    if folder.is_dir() and not any(folder.iterdir()):
        folder.rmdir()
