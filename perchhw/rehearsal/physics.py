"""Where the approach of a rehearsal is flown."""

from enum import StrEnum


class Physics(StrEnum):
    """Who moves the drone that stands on its desk."""

    HOST = "host"
    """The host sends poses of the ideal approach, and the drone's estimator makes what it can of them."""
    DRONE = "drone"
    """A model of the vehicle on the drone, by the forces that its own law asks for."""
