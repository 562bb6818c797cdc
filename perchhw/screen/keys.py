"""What a key does: a thread with nothing else to do reads them, so that no drawing keeps a stop.

The keys that end a flight are signals to the flight's process and share with the screen nothing that could
keep them: they work while the terminal takes no output. The others go as messages.
"""

import codecs
import os
import signal
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

from perchhw.operator_signals import CUT, LAND
from perchhw.screen.snapshot import Snapshot

Send = Callable[[dict[str, Any]], None]
_ENTER, _ESCAPE, _ERASE, _END = "\r\n", "\x1b", "\x7f\b", "\x04"
NOBODY = "nobody"
"""The key that says that no key will come any more."""


@dataclass
class Keys:
    """Turns keys into signals and messages.

    Args:
        flight: process id of the flight.
        send: gives a message to it.

    Attributes:
        snapshot: what is shown; it says whether words are wanted.
        typed: words of the present answer so far.
    """

    flight: int
    send: Send
    snapshot: Snapshot = field(default_factory=lambda: Snapshot(title=""))
    typed: str = ""
    _answered: int = 0
    _decoder: codecs.IncrementalDecoder = field(default_factory=codecs.getincrementaldecoder("utf-8"))

    @property
    def _typing(self) -> bool:
        """Words are wanted, which happens between flights only; else every key is an order."""
        return self.snapshot.wants_words and self.snapshot.question_number > self._answered

    def press(self, read: bytes) -> None:
        """What came from the terminal in one go."""
        if not self._typing:
            self._order(read)
            return
        if read.startswith(_ESCAPE.encode()):
            if len(read) == 1:  # longer ones are arrows and the like
                self._answer("")
            return
        for character in self._decoder.decode(read):
            if character in _ENTER:
                self._answer(self.typed)
                return
            if character in _ERASE:
                self.typed = self.typed[:-1]
            elif character.isprintable():
                self.typed += character

    def _order(self, read: bytes) -> None:
        if b" " in read:  # first, and wherever it stands
            self._signal(CUT)
            return
        if read.startswith(_ESCAPE.encode()):
            return
        for key in read.decode("ascii", "ignore").lower():
            if key == "l":
                self._signal(LAND)
            elif key in "pn":
                self.send({"key": key})
            elif key == _END:
                self.send({"key": NOBODY})
            elif key in _ENTER and self.snapshot.question is not None:
                self._answer("")

    def _answer(self, words: str) -> None:
        number = self.snapshot.question_number
        if number > self._answered:
            self._answered, self.typed = number, ""
            self.send({"answer": words, "number": number})

    def _signal(self, number: signal.Signals | None) -> None:
        """To the flight, as long as it is our parent: its number may be another's later."""
        if number is not None and os.getppid() == self.flight:
            os.kill(self.flight, number)
