"""What a script or a notebook gives: numbers of numpy become plain ones, what is of another kind is told."""

from collections.abc import Iterable
from numbers import Integral, Real
from pathlib import Path
from reprlib import repr as short

from onboard.errors import InputError, OnboardError


class ArgumentError(OnboardError, InputError):
    """Something of another kind than is asked for was given: the message says what, and what to give."""


def checked_number(value: object, name: str) -> float:
    """The number that was given as `name`.

    Raises:
        ArgumentError: it is none.
    """
    if isinstance(value, bool) or not isinstance(value, Real):
        raise ArgumentError(f"{name}: {short(value)} is no number")
    return float(value)


def checked_numbers(values: object, name: str) -> tuple[float, ...]:
    """The numbers that were given as `name`.

    Raises:
        ArgumentError: one of them is none, or they are no list of them.
    """
    if isinstance(values, str) or not isinstance(values, Iterable):
        raise ArgumentError(
            f"{name}: {short(values)} is no list of numbers; write one number in brackets, too"
        )
    return tuple(checked_number(value, name) for value in values)


def checked_count(value: object, name: str, least: int = 0) -> int:
    """The whole number that was given as `name`.

    Raises:
        ArgumentError: it is none, or below `least`.
    """
    if isinstance(value, bool) or not isinstance(value, Integral) or value < least:
        raise ArgumentError(f"{name}: {short(value)} is no whole number of at least {least}")
    return int(value)


def checked_name(value: object, name: str, give: str = "a name or a file") -> str:
    """The name or path that was given as `name`.

    Raises:
        ArgumentError: it is neither, or empty; the message says to `give` what may be given.
    """
    if isinstance(value, str | Path) and str(value).strip():
        return str(value)
    given = "is empty" if isinstance(value, str) else f"is a {type(value).__name__}"
    raise ArgumentError(f"{name} {given}: give {give}")
