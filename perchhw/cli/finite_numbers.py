"""Numbers of the command line are finite: ``nan`` and ``inf`` are refused.

In one place, before a verb sees them, for every number option there is and will be.
"""

import functools
import math
from collections.abc import Callable, Mapping
from typing import Any

from onboard.errors import InputError


def with_finite_numbers(command: Any) -> Any:
    """The command as built by :func:`typer.main.get_command`, with those of its groups; changed in place.

    Raises:
        InputError: by the command, when it runs: an option's value is not finite.
    """
    for below in getattr(command, "commands", {}).values():
        with_finite_numbers(below)
    if command.callback is not None:
        names = {one.name: one.opts[0] if one.opts else one.name for one in command.params}
        command.callback = _checked(command.callback, names)
    return command


def _checked(callback: Callable[..., Any], names: Mapping[str, str]) -> Callable[..., Any]:
    @functools.wraps(callback)
    def checked(*arguments: Any, **values: Any) -> Any:
        for name, value in values.items():
            if isinstance(value, float) and not math.isfinite(value):
                raise InputError(f"{names.get(name, name)}: {value} is not a finite number")
        return callback(*arguments, **values)

    return checked
