"""Errors of the bifilar fit."""

from calibration.errors import CalibrationError
from onboard.errors import InputError


class SwingFileError(CalibrationError, InputError):
    """A recording cannot be read; the message names the file and, where there is one, row and column."""


class UnusableSwingError(CalibrationError, InputError):
    """A recording was read but holds nothing that could be fitted; the message says why and what to do."""


class RigError(CalibrationError, InputError):
    """Masses, lengths or hangs that cannot be used together; the message says which."""
