"""The terminal's own settings: whether a screen is fit for it, keys one by one, and everything as it was."""

import contextlib
import os
import sys
import termios
from collections.abc import Iterator

from perchhw.consoles import progress_console

LEAVE = b"\x1b[?1049l\x1b[?25h\x1b[0m"
"""Out of the alternate screen, cursor on, colours off (xterm control sequences)."""
_LFLAG, _CC = 3, 6
Settings = list[int | list[bytes | int]]


def fit_for_a_screen() -> bool:
    """Whether a person sits before a terminal that can show a screen, and this process may read its keys."""
    if sys.stdin is None or sys.stderr is None or not (sys.stdin.isatty() and sys.stderr.isatty()):
        return False
    console = progress_console()
    return console.is_terminal and not console.is_dumb_terminal and _in_front(sys.stdin.fileno())


def _in_front(terminal: int) -> bool:
    """Whether the terminal's keys come to this process: a job in the background would be stopped by it."""
    try:
        return os.tcgetpgrp(terminal) == os.getpgrp()
    except OSError:
        return False


def settings_of(terminal: int) -> Settings:
    """The settings now."""
    return termios.tcgetattr(terminal)


def one_by_one(terminal: int) -> None:
    """Keys come at once and unseen; those of signals (Ctrl-C, Ctrl-Z, Ctrl-\\) stay what they are."""
    wanted = termios.tcgetattr(terminal)
    wanted[_LFLAG] &= ~(termios.ICANON | termios.ECHO)
    wanted[_CC][termios.VMIN], wanted[_CC][termios.VTIME] = 1, 0
    termios.tcsetattr(terminal, termios.TCSANOW, wanted)


def restore(terminal: int, settings: Settings) -> None:
    """As it was, without waiting for what is still to be shown; keys that nobody read are dropped."""
    with contextlib.suppress(termios.error):  # the terminal is gone
        termios.tcsetattr(terminal, termios.TCSANOW, settings)
        termios.tcflush(terminal, termios.TCIFLUSH)


@contextlib.contextmanager
def keys_of(terminal: int) -> Iterator[None]:
    """Keys one by one, until the end of the block."""
    before = settings_of(terminal)
    one_by_one(terminal)
    try:
        yield
    finally:
        restore(terminal, before)
