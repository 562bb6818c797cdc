"""Errors of the ``mocap_bridge`` package."""

from onboard.errors import InputError, PerchhwError


class MocapError(PerchhwError):
    """Base of the errors of the ``mocap_bridge`` package."""


class MocapUriError(MocapError, InputError):
    """A mocap URI that cannot be used: the message says which part and shows a right one."""


class PacketError(MocapError):
    """Bytes that are not what the protocol allows: wrong magic, length, count or value."""


class PoseTimeout(MocapError):
    """No frame arrived in the time given; the source may still be alive."""


class SourceLost(MocapError):
    """The source is gone: refused, closed, silent at the handshake, or not speaking its protocol."""


class SourceUnusable(MocapError):
    """The source is alive but cannot serve us as it is set up (axes, frames without subjects)."""


class SourceBroken(MocapError):
    """The code of the source failed: opening it again would not help, somebody has to mend it."""


class ListenerBroken(MocapError):
    """The code of who is told of every pose failed: no source can help it, somebody has to mend it."""


class UnknownSubject(SourceUnusable):
    """The source does not know the subject asked for; `offered` has the names that it does know."""

    def __init__(self, message: str, offered: tuple[str, ...]) -> None:
        super().__init__(message)
        self.offered = offered
