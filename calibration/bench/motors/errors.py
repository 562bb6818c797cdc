"""Errors of the tachometer's fits and files."""

from calibration.errors import CalibrationError
from onboard.errors import InputError


class TachometerError(CalibrationError, InputError):
    """A recording that cannot be used. The message names the file and row, or what is missing in the data."""
