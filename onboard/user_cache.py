"""Where this user's files are that can be made again, and where they are for now if that cannot be written.

A folder for now goes with the last process that uses it (:mod:`onboard.held_folder`).
"""

import atexit
import errno
import logging
import os
import shutil
import tempfile
from contextlib import suppress
from functools import cache
from pathlib import Path

from onboard.errors import InputError, OnboardError
from onboard.held_folder import hold_folder, new_held_folder, take_away_left

_log = logging.getLogger(__name__)

_FOR_NOW = "perchhw-for-now-"
"""How names of such folders begin; those of earlier versions, without locks, began otherwise."""

_TOLD = "PERCHHW_CACHE_THAT_CANNOT_BE_WRITTEN"
"""Variable by which those that a process starts know of which cache it has said so."""

_ROOM = 1 << 20
"""Bytes: the drone's code in C with what its compiler writes beside it, or the largest of the kernels."""

_FULL = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)


class NoCache(OnboardError, InputError):
    """Nothing can be written where compiled code could be; the message says what to name."""


def user_cache() -> Path:
    """``$XDG_CACHE_HOME/perchhw``, or ``~/.cache/perchhw``; it may not exist yet."""
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "perchhw"


def cache_for_compiled(name: str) -> Path:
    """The folder `name` of the cache, made; where it cannot be written, a new one with what it holds, for as
    long as this process runs and those that use it, too (:func:`keep_for_now`). Where both disks are full it
    is the cache still: what it holds is used, and what it lacks is compiled anew.

    Raises:
        NoCache: neither can be written.
    """
    return _writable(user_cache() / name)


@cache
def _writable(folder: Path) -> Path:
    take_away_left(_FOR_NOW)
    try:
        folder.mkdir(parents=True, exist_ok=True)
        _try_to_write(folder)
    except OSError as problem:
        reason, full = problem.strerror or str(problem), problem.errno in _FULL
    else:
        return folder
    for_now = _copied_for_now(folder)
    if for_now is None and not (full and folder.is_dir()):
        raise NoCache(
            f"neither {folder} ({reason}) nor the folder of temporary files can be written, and what is "
            "compiled must be put somewhere: name folders that can by XDG_CACHE_HOME and TMPDIR"
        )
    _tell_once(folder, reason, "make room there, or " if full else "")
    return for_now or folder


def _tell_once(folder: Path, reason: str, remedy: str) -> None:
    """Say what is wrong with the cache, unless this process or the one that started it has said so."""
    if os.environ.get(_TOLD) == str(user_cache()):
        return
    os.environ[_TOLD] = str(user_cache())
    _log.error(
        "%s cannot be written (%s): what is compiled is not kept, which costs every start its time; %sname "
        "another folder by XDG_CACHE_HOME",
        folder,
        reason,
        remedy,
    )


def _try_to_write(folder: Path) -> None:
    """As numba asks, which goes elsewhere by itself; a full disk takes a file, but nothing into it."""
    with tempfile.TemporaryFile(dir=folder) as file:
        file.write(bytes(_ROOM))
        file.flush()


def _copied_for_now(folder: Path) -> Path | None:
    """A folder for now with what `folder` holds; None where nothing can be written either."""
    try:
        for_now = _new_for_now()
        with suppress(OSError):  # of which shutil's are
            shutil.copytree(folder, for_now, dirs_exist_ok=True)
        for inside, _, _ in os.walk(for_now):
            Path(inside).chmod(0o700)  # a folder that is read-only was copied as one
        _try_to_write(for_now)
    except OSError:
        return None
    return for_now


@cache
def keep_for_now(folder: Path) -> None:
    """Use a folder for now, as a process that got it from the one that started it: it stays until this one
    ends, too. Any other folder stays anyway.
    """
    if folder.name.startswith(_FOR_NOW):
        with suppress(OSError):  # who has no room for a folder keeps nothing
            atexit.register(hold_folder(folder).let_go)


def _new_for_now() -> Path:
    held = new_held_folder(_FOR_NOW)
    atexit.register(held.let_go)
    return held.path
