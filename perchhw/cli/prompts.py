"""Asking the operator: every prompt has a flag that answers it, and none waits where nobody can answer."""

import sys
from collections.abc import Callable

from onboard.errors import InputError
from perchhw.cli.output import progress_console
from perchhw.errors import FlightStackError


class NobodyToAsk(FlightStackError, InputError):
    """A verb would have to ask, but there is no terminal."""


def confirmation(yes: bool) -> Callable[[str], None]:
    """Something that asks the operator to do what it is told and returns when it is done.

    Args:
        yes: answer for the operator (``--yes``).

    Raises:
        NobodyToAsk: at once, when it would have to ask without a terminal; or from what is returned, when
            the terminal is gone.
    """
    if not yes and not sys.stdin.isatty():
        raise NobodyToAsk(
            "this would ask the operator before each attempt, but there is no terminal: add --yes"
        )
    screen = progress_console()

    def confirm(request: str) -> None:
        if yes:
            screen.print(f"{request}.", style="dim", markup=False)
        else:
            try:
                screen.input(f"{request}, then press Enter. ", markup=False)
            except (EOFError, OSError) as error:  # Ctrl-D, or the terminal has gone
                raise NobodyToAsk("nobody answers any more: the drone was left as it is") from error

    return confirm
