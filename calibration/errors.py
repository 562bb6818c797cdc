"""Errors of the ``calibration`` package."""

from onboard.errors import PerchhwError


class CalibrationError(PerchhwError):
    """Base of the errors of the ``calibration`` package."""
