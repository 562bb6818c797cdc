"""Signals by which another process ends a flight of this one: what the keys of its screen send.

Where nothing flies they end the command, as Ctrl-C does: whoever sends them wants nothing to take off.
"""

import signal
import threading
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from typing import Any


def known(*names: str) -> tuple[signal.Signals, ...]:
    """Those of the named signals that this system has: Windows lacks most of them."""
    return tuple(getattr(signal, name) for name in names if hasattr(signal, name))


LAND: signal.Signals | None = getattr(signal, "SIGUSR1", None)
"""Asks for a landing, however often it comes; None where the system has no such signal."""
CUT: signal.Signals | None = getattr(signal, "SIGUSR2", None)
"""Cuts the motors at once: both of an operator's Ctrl-C in one."""
ENDS = known("SIGTERM", "SIGHUP")
"""End a command as Ctrl-C does: somebody's ``kill``, and a terminal that closes."""

_OF_KEYS = known("SIGQUIT", "SIGTSTP")
"""Ctrl-\\ and Ctrl-Z."""


def act_as_ctrl_c(numbers: Iterable[signal.Signals | None]) -> dict[signal.Signals, Any]:
    """From now on these signals end the program in order, as Ctrl-C does, but for those that it was started
    to ignore.

    Only the main thread can say so; elsewhere nothing changes.

    Returns:
        The handlers that they had.
    """
    if threading.current_thread() is not threading.main_thread():
        return {}
    return {
        number: signal.signal(number, signal.default_int_handler)
        for number in numbers
        if number is not None and signal.getsignal(number) is not signal.SIG_IGN
    }


@contextmanager
def ending_in_order() -> Iterator[None]:
    """While motors may turn that nothing else stops, or a screen is shown: what ends or suspends a program by
    default, also a terminal that closes, Ctrl-\\ and Ctrl-Z, ends it in order.
    """
    before = act_as_ctrl_c((*ENDS, *_OF_KEYS))
    try:
        yield
    finally:
        _restore(before)


@contextmanager
def unheard() -> Iterator[None]:
    """While open, who ends the program once more does not: it is ending, and says what came of it."""
    ours = threading.current_thread() is threading.main_thread()
    signals = (signal.SIGINT, *ENDS, *_OF_KEYS, *(number for number in (LAND, CUT) if number is not None))
    before = {number: signal.signal(number, signal.SIG_IGN) for number in signals if ours}
    try:
        yield
    finally:
        _restore(before)


def _restore(before: Mapping[signal.Signals, Any]) -> None:
    for number, handler in before.items():
        signal.signal(number, handler)
