"""The two consoles of a command: results on stdout, everything else on stderr; colour only on a terminal."""

import sys
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rich.console import Console


def console() -> "Console":
    """On stdout, for results."""
    from rich.console import Console

    return Console(file=sys.stdout, highlight=False)


def progress_console() -> "Console":
    """On stderr, for progress, warnings and prompts."""
    from rich.console import Console

    return Console(file=sys.stderr, highlight=False)
