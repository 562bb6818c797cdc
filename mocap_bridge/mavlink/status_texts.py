"""Words for a ground station. Those about safety are numbered and repeated, because UDP loses packets.

A line is one STATUSTEXT of at most 49 bytes, which stands for itself: nobody has to put chunks together of
which one is missing. Repeats of a line have its number, in the text (``#3 ...``) and in the field ``id``.
"""

import textwrap
from collections import deque
from collections.abc import Iterator
from typing import NamedTuple

REPEATS_S = (0.0, 0.05, 0.1, 0.2, 0.4, 0.7, 1.0, 1.5, 2.0, 2.5, 3.0, 3.5, 4.0, 4.5, 5.0)
"""When a safety line is sent, s after it was said: of a link that loses 30 % at random one line in 7e7 loses
all 15."""
LINE_BYTES = 49
_KEPT = 64
_LONGEST = 250
_NUMBERS = 0xFFFF


class StatusText(NamedTuple):
    """One STATUSTEXT: severity (MAV_SEVERITY, 0 is worst), text, number (0: said once)."""

    severity: int
    text: str
    number: int


class StatusTexts:
    """What is still to be said. :meth:`say` may be called from any thread and never waits; at more than 64
    waiting lines the oldest is forgotten."""

    def __init__(self) -> None:
        self._once: deque[tuple[int, str]] = deque(maxlen=_KEPT)
        self._safety: deque[tuple[int, str]] = deque(maxlen=_KEPT)
        self._repeating: deque[tuple[float, int, StatusText]] = deque(maxlen=_KEPT)
        self._number = 0

    def say(self, text: str, severity: int, *, safety: bool = False) -> None:
        """Say it once, or as often as it takes when it is about `safety`."""
        (self._safety if safety else self._once).append((severity, text))

    @property
    def waiting(self) -> bool:
        """Whether anything is still to be said."""
        return bool(self._once or self._safety or self._repeating)

    def due(self, now: float) -> Iterator[StatusText]:
        """Lines to send at time `now` (s); from one thread."""
        while self._safety:
            severity, text = self._safety.popleft()
            for part in _parts(text, LINE_BYTES - len("#65535 ")):
                self._number = self._number % _NUMBERS + 1
                self._repeating.append(
                    (now, 0, StatusText(severity, f"#{self._number} {part}", self._number))
                )
        for _ in range(len(self._repeating)):
            said, count, line = self._repeating.popleft()
            if now >= said + REPEATS_S[count]:
                yield line
                count += 1
            if count < len(REPEATS_S):
                self._repeating.append((said, count, line))
        while self._once:
            severity, text = self._once.popleft()
            yield from (StatusText(severity, part, 0) for part in _parts(text, LINE_BYTES))


def _parts(text: str, size: int) -> list[str]:
    return textwrap.wrap(text[:_LONGEST].encode("ascii", "replace").decode("ascii"), size)
