"""Errors of the simulated bench."""

from onboard.errors import InputError
from sim_backend.errors import SimulationError


class BenchError(SimulationError):
    """The simulated bench cannot be served."""


class BenchInputError(BenchError, InputError):
    """A fault, a pace or a vehicle that the bench cannot use."""
