"""Temporary folders that go with the last process that uses them.

Each of these holds a shared lock on the folder, which the system lets go of however the process ends; who
gets it for itself alone may take the folder away. A process that was killed cannot do so: the next one that
wants a folder of that kind does.
"""

import os
import shutil
import tempfile
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

try:
    import fcntl
except ImportError:  # Windows: what a killed process leaves behind stays
    fcntl = None  # type: ignore[assignment]


@dataclass(frozen=True, slots=True)
class HeldFolder:
    """A folder that stays at least until it is let go of.

    Attributes:
        path: of the folder.
        handle: open on it, with the lock; None where there are no locks.
        made: whether this process made it, who takes it away where there are no locks.
    """

    path: Path
    handle: int | None
    made: bool

    def let_go(self) -> None:
        """Take the folder away, unless another process uses it. Once only."""
        if self.handle is not None:
            _take_away(self.path, self.handle)
            os.close(self.handle)
        elif self.made:
            shutil.rmtree(self.path, ignore_errors=True)


def new_held_folder(prefix: str) -> HeldFolder:
    """A new folder among the temporary files, whose name begins so; others may hold it, too.

    Raises:
        OSError: it cannot be made.
    """
    path, handle = Path(tempfile.mkdtemp(prefix=prefix)), None
    with suppress(OSError):  # a disk without locks: nobody else can take it away either
        handle = _locked(path)
    return HeldFolder(path, handle, made=True)


def hold_folder(path: Path) -> HeldFolder:
    """Hold a folder that another process made; it is made again where that one has just taken it away.

    Raises:
        OSError: it cannot be held.
    """
    return HeldFolder(path, _locked(path), made=False)


def take_away_left(prefix: str) -> None:
    """Take away the folders, whose names begin so, that processes of this user left when they were killed."""
    if fcntl is None:
        return
    with suppress(OSError):
        for path in Path(tempfile.gettempdir()).glob(f"{prefix}*"):
            with suppress(OSError):
                handle = os.open(path, os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW)
                if os.fstat(handle).st_uid == os.getuid():
                    _take_away(path, handle)
                os.close(handle)


def _locked(path: Path) -> int | None:
    if fcntl is None:
        return None
    while True:
        path.mkdir(mode=0o700, exist_ok=True)
        handle = os.open(path, os.O_RDONLY)
        fcntl.flock(handle, fcntl.LOCK_SH)  # waits for who is just taking it away, and was first
        if path.is_dir() and os.path.samestat(path.stat(), os.fstat(handle)):
            return handle
        os.close(handle)


def _take_away(path: Path, handle: int) -> None:
    with suppress(OSError):
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        shutil.rmtree(path, ignore_errors=True)
