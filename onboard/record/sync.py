"""Put what was written on the disk from time to time, so that a power failure costs seconds."""

import os
import threading
from collections.abc import Callable, Sequence

SYNC_PERIOD_S = 2.0
"""Time between two syncs of a record that is being written, s."""

Sync = Callable[[int], None]
"""Returns when the content of a file descriptor is on the disk."""


class PeriodicSync:
    """A thread that syncs files, so that nobody who writes waits for the disk.

    Its time is that of the machine: a disk knows no other.

    Args:
        descriptors: of the open files.
        sync: syncs one of them.
        period_s: time between two syncs.

    Attributes:
        problem: what the disk answered when it could not take a file; nothing is synced after it.
    """

    def __init__(
        self, descriptors: Sequence[int], sync: Sync = os.fsync, period_s: float = SYNC_PERIOD_S
    ) -> None:
        self.problem: OSError | None = None
        self._descriptors = tuple(descriptors)
        self._sync = sync
        self._period_s = period_s
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._run, name="record-sync", daemon=True)
        self._thread.start()

    def stop(self) -> None:
        """Sync a last time; afterwards the files may be closed."""
        self._over.set()
        self._thread.join()

    def _run(self) -> None:
        while self.problem is None:
            ended = self._over.wait(self._period_s)
            try:
                for descriptor in self._descriptors:
                    self._sync(descriptor)
            except OSError as error:
                self.problem = error
            if ended:
                return
