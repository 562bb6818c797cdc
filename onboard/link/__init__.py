"""The one door to the drone: a CRTP driver that does not hang, and ``DroneLink`` above it.

The only package that imports cflib, which takes 0.15 s; so ``DroneLink`` and what belongs to it load when
they are first used, and code that only handles the errors does not pay.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from onboard.link.errors import (
    CommandRefused,
    DroneInUse,
    DroneIsFlying,
    LinkError,
    LinkInputError,
    LinkLost,
    LinkTimeout,
    NoSuchVariable,
    PolicyRefused,
    Superseded,
)
from onboard.link.uri import check_drone_uri

if TYPE_CHECKING:
    from onboard.link.drone import DroneLink, LogSample, LogStream, reboot

__all__ = [
    "CommandRefused",
    "DroneInUse",
    "DroneIsFlying",
    "DroneLink",
    "LinkError",
    "LinkInputError",
    "LinkLost",
    "LinkTimeout",
    "LogSample",
    "LogStream",
    "NoSuchVariable",
    "PolicyRefused",
    "Superseded",
    "check_drone_uri",
    "reboot",
]


def __getattr__(name: str) -> Any:
    if name not in __all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module("onboard.link.drone"), name)
