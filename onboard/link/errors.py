"""Errors of the link to a drone."""

from typing import Final

from onboard.errors import InputError, OnboardError, SafetyStop

BROKE_WHILE_SET_UP: Final = "the connection broke while it was set up"
"""What :class:`LinkLost` says of a drone that had answered."""


class LinkError(OnboardError):
    """The link cannot do what was asked. Base of all errors of the link."""


class LinkTimeout(LinkError):
    """The drone did not answer by the deadline. Whether it acted on the request is unknown."""


class Superseded(LinkError):
    """Another thread wrote something else to the same place before this was confirmed, or whoever wanted this
    does no longer. Whether the drone acted on it is unknown."""


class LinkLost(LinkError):
    """The connection is gone: the peer vanished, fell silent, or the radio gave up. Open a new link."""


class LinkInputError(LinkError, InputError):
    """A URI, value or request that no drone could serve; nothing was sent."""


class DroneInUse(LinkError, InputError):
    """Another process of this machine talks to the drone; nothing was sent."""


class NoSuchVariable(LinkInputError):
    """The drone has no parameter, log variable or memory of this name. Usually the wrong firmware."""


class CommandRefused(LinkError):
    """The drone answered, and the answer is no."""


class DroneIsFlying(CommandRefused, SafetyStop):
    """What was asked for would bring down a drone that says that it is flying."""


class DroneStopped(LinkError, SafetyStop):
    """Somebody stopped the drone; a person has to look before anybody takes off."""


class PolicyRefused(CommandRefused):
    """The drone did not take the policy; it keeps the one that it had."""
