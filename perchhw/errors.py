"""Errors of the ``perchhw`` package."""

from onboard.errors import PerchhwError


class FlightStackError(PerchhwError):
    """Base of the errors of the ``perchhw`` package."""
