"""Signals by which another process ends a flight of this one: what the keys of its screen send."""

import signal

LAND: signal.Signals | None = getattr(signal, "SIGUSR1", None)
"""Asks for a landing, however often it comes; None where the system has no such signal."""
CUT: signal.Signals | None = getattr(signal, "SIGUSR2", None)
"""Cuts the motors at once: both of an operator's Ctrl-C in one."""
