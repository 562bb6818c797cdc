"""How every verb speaks: one JSON document on stdout with ``--json``, words for a person otherwise.

Everything that is not the result (progress, warnings, prompts) goes to stderr, so that a script can always
parse stdout.
"""

import json
import sys
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from rich.console import Console


@dataclass
class OutputSettings:
    """The global flags of the command line."""

    as_json: bool = False
    verbose: bool = False


settings = OutputSettings()


def console() -> "Console":
    """A rich console on stdout for results (colour only on a terminal)."""
    from rich.console import Console

    return Console(file=sys.stdout, highlight=False)


def progress_console() -> "Console":
    """A rich console on stderr for progress, warnings and prompts (colour only on a terminal)."""
    from rich.console import Console

    return Console(file=sys.stderr, highlight=False)


def emit(result: dict[str, Any], human: Callable[[], None] | str) -> None:
    """Give the result of a verb: one JSON document, or `human`: a text or a function that draws."""
    if settings.as_json:
        sys.stdout.write(json.dumps(result, allow_nan=False) + "\n")
        sys.stdout.flush()
    elif callable(human):
        human()
    else:
        console().print(human, markup=False, soft_wrap=True)
