"""The one tree of errors: every error that perchhw raises on purpose derives from :class:`PerchhwError`.

Each package has a base of its own (here :class:`OnboardError`). Three mixins decide how a command ends:
:class:`InputError` (exit code 2), :class:`SafetyStop` (3) and :class:`EndedByOperator` (130); every other
error ends it with 1.
"""


class PerchhwError(Exception):
    """Root of all errors of the project. The message says what happened, where, and what to do next."""


class InputError(PerchhwError):
    """Input that cannot be used: the message names the file, key or row, and what to do."""


class SafetyStop(PerchhwError):
    """A safety rule refused or stopped an action: the message names the rule and the measured value."""


class EndedByOperator(PerchhwError):
    """Whoever operates ends it here, as with Ctrl-C: nothing is wrong."""


class OnboardError(PerchhwError):
    """Base of the errors of the ``onboard`` package."""
