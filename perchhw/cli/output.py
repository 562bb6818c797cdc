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

    from perchhw.supervisor import FlightState


@dataclass
class OutputSettings:
    """The global flags of the command line, and whether the verb has given its result yet."""

    as_json: bool = False
    emitted: bool = False


settings = OutputSettings()


def console() -> "Console":
    """A rich console on stdout for results (colour only on a terminal)."""
    from rich.console import Console

    return Console(file=sys.stdout, highlight=False)


def progress_console() -> "Console":
    """A rich console on stderr for progress, warnings and prompts (colour only on a terminal)."""
    from rich.console import Console

    return Console(file=sys.stderr, highlight=False)


def show_alert(state: "FlightState") -> None:
    """Say what the operator must know at once: on stderr, with a bell and in red."""
    if state.alert is not None:
        console = progress_console()
        console.bell()
        console.print(state.alert, style="bold white on red", markup=False, soft_wrap=True)


def show_flight(state: "FlightState") -> None:
    """Say on stderr where a flight stands, and its alert."""
    show_alert(state)
    progress_console().print(f"  {state.phase.value}")


def emit_error(message: str, exit_code: int) -> None:
    """With ``--json``, the document of a verb that ended without a result, so that there is always one."""
    if settings.as_json and not settings.emitted:
        emit({"error": message, "exit_code": exit_code}, "")


def emit(result: dict[str, Any], human: Callable[[], None] | str) -> None:
    """Give the result of a verb: one JSON document, or `human`: a text or a function that draws."""
    settings.emitted = True
    if settings.as_json:
        sys.stdout.write(json.dumps(result, allow_nan=False) + "\n")
        sys.stdout.flush()
    elif callable(human):
        human()
    else:
        console().print(human, markup=False, soft_wrap=True)
