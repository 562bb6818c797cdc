"""The two consoles of a command: results on stdout, everything else on stderr; colour only on a terminal."""

import sys
import textwrap
from collections.abc import Iterator
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rich.console import Console


_NARROWEST = 20
"""Characters: a terminal that leaves fewer breaks text itself, since single words in a column read worse."""


_WHOLE = 10_000
"""Characters: wider than any table."""


def console() -> "Console":
    """On stdout, for results."""
    from rich.console import Console

    return Console(file=sys.stdout, highlight=False)


def table_console() -> "Console":
    """On stdout, for tables: cells are cut or folded for a terminal only, so that a search finds all."""
    from rich.console import Console

    screen = console()
    return screen if screen.is_terminal else Console(file=sys.stdout, highlight=False, width=_WHOLE)


def progress_console() -> "Console":
    """On stderr, for progress, warnings and prompts."""
    from rich.console import Console

    return Console(file=sys.stderr, highlight=False)


def in_width(text: str, screen: "Console", mark: str = "") -> str:
    """`text` behind `mark`, every line as far in as it began.

    A terminal gets its lines broken between words, since it breaks them anywhere itself; elsewhere a line
    stays one, for whoever searches.
    """
    width = screen.width if screen.is_terminal else None
    parts = [part for line in text.splitlines() for part in _broken(line, width, len(mark))]
    return "\n".join(f"{' ' * len(mark) if k else mark}{part}" for k, part in enumerate(parts))


def say(screen: "Console", text: str, style: str = "") -> None:
    """Print a sentence as it is, :func:`in_width`."""
    screen.print(in_width(text, screen), style=style, markup=False, soft_wrap=True)


def _broken(line: str, width: int | None, taken: int) -> Iterator[str]:
    if width is None or taken + len(line) <= width:
        yield line
        return
    indent = line[: len(line) - len(line.lstrip())]
    yield from textwrap.wrap(
        line,
        max(_NARROWEST, width - taken),
        subsequent_indent=indent,
        break_long_words=False,
        break_on_hyphens=False,
    )
