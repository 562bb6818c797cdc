"""What shows a flight here: the screen where there is a terminal for it, else lines."""

from collections.abc import Iterator
from contextlib import contextmanager

from perchhw.operator_signals import ending_in_order
from perchhw.screen.display import Display
from perchhw.screen.lines import Lines


@contextmanager
def flight_display(title: str, drone: str) -> Iterator[Display]:
    """The screen where there is a terminal for it, else lines.

    Args:
        title: the command, with what it flies.
        drone: URI.
    """
    if not _fit_for_a_screen():
        with Lines() as lines:
            yield lines
        return
    from perchhw.screen.screen import Screen

    # Between two flights, too: a command that Ctrl-Z suspends would leave its screen on the terminal.
    with ending_in_order(), Screen(title, drone) as screen:
        yield screen


def _fit_for_a_screen() -> bool:
    try:
        from perchhw.screen.terminal import fit_for_a_screen
    except ImportError:  # a system without termios
        return False
    return fit_for_a_screen()
