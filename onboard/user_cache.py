"""Where this user's files are that can be made again."""

import atexit
import logging
import os
import shutil
import tempfile
from contextlib import suppress
from functools import cache
from pathlib import Path

_log = logging.getLogger(__name__)


def user_cache() -> Path:
    """``$XDG_CACHE_HOME/perchhw``, or ``~/.cache/perchhw``; it may not exist yet."""
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "perchhw"


def cache_for_compiled(name: str) -> Path:
    """The folder `name` of the cache, made; where it cannot be written, a new one with what it holds, for as
    long as this process runs.
    """
    return _writable(user_cache() / name)


@cache
def _writable(folder: Path) -> Path:
    try:
        folder.mkdir(parents=True, exist_ok=True)
        tempfile.TemporaryFile(dir=folder).close()  # as numba asks, which goes elsewhere by itself
    except OSError as problem:
        _log.error(
            "%s cannot be written (%s): what is compiled is not kept, which costs every start its time; name "
            "another folder by XDG_CACHE_HOME",
            folder,
            problem.strerror,
        )
    else:
        return folder
    passing = Path(tempfile.mkdtemp(prefix="perchhw-compiled-"))
    atexit.register(shutil.rmtree, passing, ignore_errors=True)
    with suppress(OSError):  # of which shutil's are
        shutil.copytree(folder, passing, dirs_exist_ok=True)
    return passing
