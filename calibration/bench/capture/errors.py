"""Errors of the capture fit and its tables."""

from calibration.errors import CalibrationError
from onboard.errors import InputError


class DropTableError(CalibrationError, InputError):
    """A table of drops that cannot be used. The message names file, row and column, or what is missing."""
