"""Errors of the ``mocap_bridge`` package."""

from onboard.errors import PerchhwError


class MocapError(PerchhwError):
    """Base of the errors of the ``mocap_bridge`` package."""
