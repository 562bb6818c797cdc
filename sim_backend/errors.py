"""Errors of the ``sim_backend`` package."""

from onboard.errors import PerchhwError


class SimulationError(PerchhwError):
    """Base of the errors of the ``sim_backend`` package."""
