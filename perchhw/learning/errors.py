"""Errors of the learning."""

from onboard.errors import InputError
from perchhw.errors import FlightStackError


class LearningError(FlightStackError):
    """Base of the errors of the learning."""


class LearningInputError(LearningError, InputError):
    """Settings or a sweep folder that cannot be used: the message names the option, file or row."""
