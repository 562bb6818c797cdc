"""Proves that no edge was lost: the device's own count against the edges that arrived. Pure.

A heartbeat says how many edges there have been up to its time. Its edges have all arrived when a younger one
has, or a second later. Then the difference to the count of the first heartbeat must be the number of edges
received since. The largest deficit ever seen counts, because an edge that is lost stays lost.
"""

from collections import deque

#: After this time of the device's clock no edge is still waiting for its group to fill [us].
_SETTLED_US = 1_000_000
_U32 = 1 << 32


class EdgeCount:
    """Follows one tachometer through one epoch after the other.

    Attributes:
        lost: edges that the device counted and that did not arrive, all epochs.
        overflow: edges that the device itself lost, as its last heartbeats say, all epochs.
    """

    def __init__(self) -> None:
        self._lost_before = self._overflow_before = 0
        self._begin()

    @property
    def lost(self) -> int:
        """Edges counted by the device that did not arrive."""
        return self._lost_before + self._deficit

    @property
    def overflow(self) -> int:
        """Edges that found the device's buffer full."""
        return self._overflow_before + self._overflow

    def restart(self) -> None:
        """The device began anew, or counted edges that it did not send: the next heartbeat is the first."""
        self._lost_before, self._overflow_before = self.lost, self.overflow
        self._begin()

    def edges(self, ticks: tuple[int, ...]) -> None:
        """Edges arrived, unwrapped times [us], in order."""
        self._received.extend(ticks)
        self._settle(ticks[-1])

    def heartbeat(self, ticks: int, total: int, overflow: int) -> None:
        """A heartbeat arrived: unwrapped time [us] and its counts."""
        if not self._beats and self._base is None:
            self._first_overflow = overflow
        self._overflow = (overflow - self._first_overflow) % _U32
        self._beats.append((ticks, total))
        self._settle(ticks - _SETTLED_US)

    def _begin(self) -> None:
        self._deficit = self._overflow = self._first_overflow = self._counted = 0
        self._base: int | None = None
        self._beats: deque[tuple[int, int]] = deque()
        self._received: deque[int] = deque()

    def _settle(self, until: int) -> None:
        """Compare the heartbeats before `until` [us], whose edges have all arrived."""
        while self._beats and self._beats[0][0] < until:
            ticks, total = self._beats.popleft()
            while self._received and self._received[0] <= ticks:
                self._received.popleft()
                self._counted += 1
            if self._base is None:
                self._base, self._counted = total, 0
            self._deficit = max(self._deficit, (total - self._base - self._counted) % _U32)
