"""How much later than the quickest a message of the drone came: what has waited in a queue is not new.

A message carries the drone's time. By how much its receipt is later hangs on two clocks that nobody has set,
and on its way; the least difference is that of the message which was quickest, and what another one has
beyond that, it was later.
"""

DRIFT = 1e-4
"""s in a second, by which the drone's clock may be slower than the host's: two crystals of 50 ppm. By so much
the least difference is let grow; a faster clock makes it less by itself."""
USUAL_S = 0.01
"""A period of the fastest log blocks: so much later is usual on a radio, and no delay."""


class Downlink:
    """The messages of one log block, whose time stamps are of one clock (beyond their wrap, each block's
    start somewhere else)."""

    def __init__(self) -> None:
        self._least: float | None = None
        self._noted_at = 0.0

    def late(self, receipt_time: float, drone_time_ms: int) -> float:
        """By how much this message was later than the quickest, s; 0 for what is usual.

        A drone whose clock jumps back by a restart counts as late, until the link is opened again.
        """
        difference = receipt_time - 1e-3 * drone_time_ms
        if self._least is None:
            self._least = difference
        else:
            forgotten = DRIFT * max(0.0, receipt_time - self._noted_at)
            self._least = min(self._least + forgotten, difference)
        self._noted_at = receipt_time
        late = difference - self._least
        return late if late > USUAL_S else 0.0
