"""Numbers that a script or a notebook gives: those of numpy become plain ones, what is none is refused."""

from numbers import Real

from onboard.errors import InputError, OnboardError


class GivenError(OnboardError, InputError):
    """Something of another kind than is asked for was given: the message says what, and what to give."""


def given_number(value: object, name: str) -> float:
    """The number that was given as `name`.

    Raises:
        GivenError: it is none.
    """
    if isinstance(value, bool) or not isinstance(value, Real):
        raise GivenError(f"{name} is {value!r}: give a number")
    return float(value)
