"""Asking the operator: every prompt has a flag that answers it, and none waits where nobody can answer."""

import sys
from collections.abc import Callable
from typing import TYPE_CHECKING

from perchhw.errors import NobodyToAsk

if TYPE_CHECKING:
    from perchhw.screen.display import Display


def confirmation(yes: bool, display: "Display") -> Callable[[str], None]:
    """Something that asks the operator to do what it is told and returns when it is done.

    Args:
        yes: answer for the operator (``--yes``).
        display: where the operator is asked.

    Raises:
        NobodyToAsk: at once, when it would have to ask without a terminal; or from what is returned, when
            the terminal is gone.
    """
    if not yes and not sys.stdin.isatty():
        raise NobodyToAsk(
            "this would ask the operator to make the drone ready, but there is no terminal: where it stands "
            "ready, add --yes"
        )
    return (lambda request: display.say(f"not asked (--yes): {request}.")) if yes else display.confirm
