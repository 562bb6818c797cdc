"""Errors of the thrust-voltage fits and tables."""

from calibration.errors import CalibrationError
from onboard.errors import InputError


class ThrustTableError(CalibrationError, InputError):
    """A table or fit that cannot be used. The message names file and row, or what is missing."""
