"""A bounded queue between a reader thread and whoever uses its samples; it never drops silently."""

import threading
from collections import deque
from typing import Generic, TypeVar

from calibration.bench.instruments.errors import InstrumentError

T = TypeVar("T")


class Mailbox(Generic[T]):
    """Holds up to `limit` items; beyond that the new ones are refused and counted.

    Attributes:
        refused: items that found it full.
    """

    def __init__(self, limit: int) -> None:
        self.refused = 0
        self._limit = limit
        self._items: deque[T] = deque()
        self._changed = threading.Condition()
        self._failure: InstrumentError | None = None

    def put(self, item: T) -> None:
        """Add an item, or count it as refused."""
        with self._changed:
            if len(self._items) >= self._limit:
                self.refused += 1
                return
            self._items.append(item)
            self._changed.notify_all()

    def fail(self, error: InstrumentError) -> None:
        """Nothing comes any more; who takes gets what there is, then this error."""
        with self._changed:
            self._failure = error
            self._changed.notify_all()

    @property
    def failure(self) -> InstrumentError | None:
        """Why nothing comes any more, or None."""
        return self._failure

    def take(self, within_s: float) -> list[T]:
        """All items; waits up to `within_s` [s] for the first one. Empty when none came.

        Raises:
            InstrumentError: the one of :meth:`fail`, once the items before it are taken.
        """
        with self._changed:
            self._changed.wait_for(lambda: self._items or self._failure is not None, within_s)
            if not self._items and self._failure is not None:
                raise self._failure
            items = list(self._items)
            self._items.clear()
            return items
