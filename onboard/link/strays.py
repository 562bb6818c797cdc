"""Copies of a write that may still be under way when another value is written.

A write that was sent again because its answer was late can be overtaken: its first answer settles it, the
next value is written, and then the other copy arrives and the old value is back, without anybody being told.
So another value is not settled before such copies have come home or are too old to arrive, and a copy sent
after that was answered. Its first packet leaves at once all the same: what disarms must not wait.
"""

from typing import NamedTuple

#: Age at which a datagram that has not arrived never will [s]; networks that reorder hold one back for
#: milliseconds, retries of a wireless link for some hundred.
LIFETIME_S = 0.5
_NEVER = float("-inf")
_SEVERAL = b""


class _Strays(NamedTuple):
    payload: bytes
    copies: int
    until: float


class StrayWrites:
    """Which keys of requests have copies under way that nobody waits for. Not thread-safe."""

    def __init__(self) -> None:
        self._strays: dict[bytes, _Strays] = {}

    def left(self, key: bytes, payload: bytes, copies: int, last_sent: float, now: float) -> None:
        """From `now` on [s] nobody waits for the answers to `copies` of this request."""
        before = self._strays.get(key)
        if before is not None and now < before.until:
            payload = payload if payload == before.payload else _SEVERAL
            copies += before.copies  # whose answer it was that settled this request is not known
        if copies > 0:
            self._strays[key] = _Strays(payload, copies, last_sent + LIFETIME_S)

    def came_home(self, key: bytes) -> None:
        """An answer came that nobody waited for."""
        strays = self._strays.pop(key, None)
        if strays is not None and strays.copies > 1:
            self._strays[key] = strays._replace(copies=strays.copies - 1)

    def threaten(self, key: bytes, payload: bytes, now: float) -> float:
        """Until when a copy with another payload may arrive [s]; in the past: none can."""
        strays = self._strays.get(key)
        if strays is None or strays.payload == payload or strays.until <= now:
            return _NEVER
        return strays.until
