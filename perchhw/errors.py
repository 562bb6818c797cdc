"""Errors of the ``perchhw`` package."""

from onboard.errors import InputError, PerchhwError


class FlightStackError(PerchhwError):
    """Base of the errors of the ``perchhw`` package."""


class NobodyToAsk(FlightStackError, InputError):
    """A verb would have to ask, but there is no terminal."""
