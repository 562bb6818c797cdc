"""What a survey of a room refuses."""

from calibration.errors import CalibrationError
from onboard.errors import InputError


class GeometryRefused(CalibrationError, InputError):
    """Measured places that do not tell what is sought; the message says what to do."""
