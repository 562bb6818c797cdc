"""One process of a machine at a time talks to a drone; ``perchhw stop`` alone asks nobody.

A second client does harm by its mere connecting: the drone forgets the log blocks of the first and answers
the second; what that one then sends may end the flight. So every link and every reboot takes the drone's lock
before its first packet. It is an advisory lock (flock) on a small file, which the kernel releases when the
process dies, however it dies. Within a process it is counted: several links to one drone are its own affair.

Where no file can be made or locked, that is told and the drone may be flown: somebody on a broken disk must
still get a drone down, and the drone's link itself sends nothing that ends the flight of others
(:class:`onboard.link.crazyflie.GuardedCrazyflie`).
Windows has no such locks.
"""

import contextlib
import logging
import os
import threading
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Self

from onboard.link.errors import DroneInUse
from onboard.link.machine_files import drone_key, file_of, files_ending, open_for_all
from onboard.link.uri import stop_command
from onboard.lock_note import holder, read_note, write_note

try:
    import fcntl
except ImportError:  # Windows
    fcntl = None  # type: ignore[assignment]

_ENDING = ".lock"
_log = logging.getLogger(__name__)


@dataclass(slots=True)
class _Held:
    """A lock of this process: a locked file (None: there are no locks here), and how often it is wanted."""

    file: int | None
    path: Path
    holds: int = 0

    def unlock(self) -> None:
        """Take the file away while it is still locked: whoever waits for it finds that it has gone."""
        if self.file is not None:
            with contextlib.suppress(OSError):  # another user made it
                self.path.unlink()
            os.close(self.file)


_guard = threading.Lock()
_held: dict[str, _Held] = {}


class DroneHold:
    """One use of a drone by this process, until :meth:`release`; a context manager. Made by :func:`hold`."""

    def __init__(self, key: str) -> None:
        self._key: str | None = key

    def release(self) -> None:
        """Give the drone back; with the last hold of the process it is free for others. Idempotent."""
        with _guard:
            key, self._key = self._key, None
            if key is None:
                return
            held = _held[key]
            held.holds -= 1
            if held.holds == 0:
                del _held[key]
                held.unlock()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.release()


def hold(uri: str) -> DroneHold:
    """Keep other processes off the drone at `uri`; returns at once.

    Raises:
        LinkInputError: the URI cannot be used.
        DroneInUse: another process talks to it; the message says which.
    """
    key = drone_key(uri)
    with _guard:
        held = _held.get(key)
        if held is None:
            path = file_of(uri, _ENDING)
            held = _held[key] = _Held(_locked_file(uri, path), path)
        held.holds += 1
    return DroneHold(key)


def drones_in_use() -> list[str]:
    """Addresses of the drones with which processes of this machine talk now, by what they noted; no lock is
    taken, and none in the way of anybody.
    """
    found = []
    for path in files_ending(_ENDING):
        with contextlib.suppress(OSError):  # just given back, or of a process that was killed
            process, uri, _ = read_note(path)
            os.kill(process, 0)
            found.append(uri)
    return found


def _locked_file(uri: str, path: Path) -> int | None:
    """The drone's file, open and locked, with who holds it; None where there are no locks."""
    if fcntl is None:
        return None
    try:
        file = _lock(path)
    except BlockingIOError as taken:
        raise DroneInUse(
            f"{uri} is in use by {holder(path)}: wait for it, or stop the drone with {stop_command(uri)}"
        ) from taken
    except OSError as error:
        _log.error(
            "cannot keep other processes off %s (%s: %s): see to it that none talks to it", uri, path, error
        )
        return None
    write_note(file, uri)
    return file


def _lock(path: Path) -> int:
    """Lock the file of this name; BlockingIOError when another process has."""
    while True:
        file = open_for_all(path)
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            if os.path.samestat(os.fstat(file), path.stat()):
                return file
        except FileNotFoundError:
            pass  # taken away by whoever held it
        except OSError:
            os.close(file)
            raise
        os.close(file)
