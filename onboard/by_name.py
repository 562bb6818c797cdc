"""What a table names by its dotted name, so that reading the table imports nothing of it."""

from importlib import import_module
from typing import Any


def imported(name: str) -> Any:
    """What ``module.name`` stands for; its module is imported now.

    Raises:
        ImportError, AttributeError: there is no such module or name.
    """
    module, _, own = name.rpartition(".")
    return getattr(import_module(module), own)
