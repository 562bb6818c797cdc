"""The one clock: monotonic, in seconds, injected wherever time matters."""

import time
from collections.abc import Callable

Clock = Callable[[], float]
"""Gives the present time in s. Only differences mean anything."""

monotonic: Clock = time.monotonic
"""The clock of a real run: on one machine the same for all processes."""
