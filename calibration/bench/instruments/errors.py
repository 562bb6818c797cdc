"""Errors of the instruments."""

from calibration.errors import CalibrationError
from onboard.errors import InputError, SafetyStop


class InstrumentError(CalibrationError):
    """An instrument cannot do what was asked. Base of all errors of this package."""


class InstrumentInputError(InstrumentError, InputError):
    """An address, value or setting that no instrument could serve; nothing was sent."""


class InstrumentNotFound(InstrumentInputError):
    """There is no such port, it may not be opened, or another program has it."""


class InstrumentLost(InstrumentError):
    """The instrument vanished (unplugged) or fell silent. Plug it in again and re-open it."""


class InstrumentTimeout(InstrumentError):
    """No answer by the deadline; whether the instrument acted on the request is unknown."""


class WrongDevice(InstrumentError):
    """Something answers on this port, but it is not the instrument that was asked for."""


class WrongBaudRate(InstrumentError):
    """Bytes arrive that are no text: the speed of the port is not that of the device."""


class InstrumentRefused(InstrumentError):
    """The instrument answered, and the answer is an error of its own."""


class ScaleUnusable(InstrumentError):
    """A scale's readings cannot be used; the message says what is wrong with them."""


class MotorsRefused(InstrumentError, SafetyStop):
    """The motors do not start, because a rule of the bench is not met."""


class MotorsNotStopped(InstrumentError, SafetyStop):
    """A stop was sent and the drone did not confirm it: cut the power by hand."""
