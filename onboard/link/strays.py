"""Copies of a write that may still be under way when another value is written.

A write that was sent again because its answer was late can be overtaken: its first answer settles it, the
next value is written, and then the other copy arrives and the old value is back, without anybody being told.
So another value is not settled before such copies have come home or are too old to arrive, and a copy sent
after that was answered. Its first packet leaves at once all the same: what disarms must not wait.

Copies come home as answers that nobody waits for. A network that doubles datagrams shows itself by one answer
too many; from then on answers are not counted, and every write may have a copy under way.
"""

from collections import OrderedDict
from typing import NamedTuple

#: Age at which neither a datagram that has not arrived nor its answer ever will [s]; networks that reorder
#: hold one back for milliseconds, retries of a wireless link for some hundred.
LIFETIME_S = 0.5
#: As that [s], for commands to the planner, which are no writes of a parameter: 0.3 s each way.
COMMAND_LIFETIME_S = 0.6
_NEVER = float("-inf")
_SEVERAL = b""


class _Strays(NamedTuple):
    payload: bytes
    copies: int
    until: float


class StrayCopies:
    """Which requests have copies under way that nobody waits for. Not thread-safe.

    Attributes:
        doubled: the network doubles datagrams.
    """

    def __init__(self) -> None:
        self.doubled = False
        self._strays: OrderedDict[bytes, _Strays] = OrderedDict()

    def left(self, key: bytes, payload: bytes, copies: int, last_sent: float, now: float) -> None:
        """From `now` on [s] nobody waits for the answers to `copies` of this request, the last of which was
        sent at `last_sent` [s]."""
        before = self._strays.pop(key, None)
        if before is not None and now < before.until and (before.copies or self.doubled):
            payload = payload if payload == before.payload else _SEVERAL
            copies += before.copies  # whose answer it was that settled this request is not known
        self._strays[key] = _Strays(payload, max(copies, 0), last_sent + LIFETIME_S)
        while self._strays and next(iter(self._strays.values())).until <= now:
            self._strays.popitem(last=False)

    def came_home(self, key: bytes, now: float) -> None:
        """An answer came at `now` [s] that nobody waited for."""
        strays = self._strays.get(key)
        if strays is None or now > strays.until:
            return
        if strays.copies == 0:
            self.doubled = True
        else:
            self._strays[key] = strays._replace(copies=strays.copies - 1)

    def threaten(self, key: bytes, payload: bytes, now: float) -> float:
        """Until when a copy with another payload may arrive [s]; in the past: none can."""
        strays = self._strays.get(key)
        if strays is None or strays.payload == payload or (strays.copies == 0 and not self.doubled):
            return _NEVER
        return strays.until
