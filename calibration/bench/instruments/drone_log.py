"""Log variables of the drone as arrays on its own clock, with the losses counted."""

import itertools
import time
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from calibration.bench.instruments.errors import InstrumentLost, MotorsRefused
from calibration.bench.instruments.mailbox import Mailbox
from onboard.clock import monotonic
from onboard.closing import Closing
from onboard.link import DroneLink, LogSample

PERIOD_MS = 10
#: Without a sample for so long the drone is off, has rebooted, or is out of reach [s].
SILENCE_MAX_S = 0.5
_READ_FIRST_S = 0.02
_SAMPLES_MAX = 60_000


@dataclass(frozen=True, slots=True)
class LogBatch:
    """Samples since the last look.

    Attributes:
        times: (n,), drone time since its boot, wraps undone [s].
        receipts: (n,), host clock [s]; jitters by some ms, use `times`.
        values: (n,) by name, in the firmware's units.
        lost: samples missing within, and between this batch and the one before.
    """

    times: NDArray[np.float64]
    receipts: NDArray[np.float64]
    values: dict[str, NDArray[np.float64]]
    lost: int


class DroneLog(Closing):
    """One running log block; a context manager."""

    def __init__(self, drone: DroneLink, names: Sequence[str], period_ms: int = PERIOD_MS) -> None:
        """Start the block.

        Raises:
            NoSuchVariable: other firmware. LinkInputError: more than 26 bytes. LinkLost, LinkTimeout.
        """
        self._drone = drone
        self._names = tuple(names)
        self._period_ms = period_ms
        self._last_ms: int | None = None
        self._box: Mailbox[LogSample] = Mailbox(_SAMPLES_MAX)
        self._stream = drone.stream(names, period_ms, self._box.put)
        self._started = monotonic()

    @property
    def latest(self) -> LogSample | None:
        """The youngest sample, also when it was taken already; None before the first."""
        return self._stream.latest

    @property
    def overrun(self) -> int:
        """Samples that this program was too slow for."""
        return self._stream.dropped + self._box.refused

    def check(self, silence_max_s: float | None = None) -> None:
        """Whether samples still come; `silence_max_s` is how long none may [s], by default 0.5 s times the
        link's patience.

        Raises:
            LinkLost: the link is gone. InstrumentLost: the drone sends no samples any more.
        """
        if self._drone.lost is not None:
            raise self._drone.lost
        if silence_max_s is None:
            silence_max_s = SILENCE_MAX_S * self._drone.patience
        if self._silence() > silence_max_s:
            time.sleep(_READ_FIRST_S)  # a process that was paused first reads what came meanwhile
            silence = self._silence()
            if silence > silence_max_s:
                raise InstrumentLost(
                    f"{self._drone.uri} sends no {self._names[0]} for {silence:.1f} s although the link "
                    "stands: did it reboot (brown-out), or does another program talk to it? Connect again"
                )

    def _silence(self) -> float:
        """Since the youngest sample, or since the log was started [s]."""
        return min(self._stream.age(), monotonic() - self._started)

    def take(self, within_s: float = 1.0) -> LogBatch:
        """Samples since the last call; waits up to `within_s` [s, at most 1] for the first.

        Raises:
            LinkLost, InstrumentLost: as for :meth:`check`.
        """
        samples = self._box.take(min(within_s, 1.0))
        if not samples:
            self.check()
        stamps = [sample.drone_time_ms for sample in samples]
        return LogBatch(
            1e-3 * np.array(stamps, dtype=np.float64),
            np.array([sample.receipt_time for sample in samples], dtype=np.float64),
            {
                name: np.array([sample.values[name] for sample in samples], dtype=np.float64)
                for name in self._names
            },
            self._missing(stamps),
        )

    def close(self) -> None:
        """End the block; idempotent."""
        self._stream.close()

    def _missing(self, stamps: list[int]) -> int:
        """Samples that are missing by the steps between stamps [ms]."""
        known = stamps if self._last_ms is None else [self._last_ms, *stamps]
        self._last_ms = known[-1] if known else None
        steps = (after - before for before, after in itertools.pairwise(known))
        return sum(max(0, round(step / self._period_ms) - 1) for step in steps)


def refuse_armed(drone: DroneLink) -> None:
    """Raise unless the motors are disarmed. A firmware that arms by itself is let through: it has no other
    state, and without a setpoint its motors stand still.

    Raises:
        MotorsRefused: armed, or flying. LinkTimeout, LinkLost.
    """
    info = drone.supervisor_info()
    if info.is_flying:
        raise MotorsRefused(f"{drone.uri} is flying (or its motors turn): land it, then start again")
    if info.is_armed and not info.auto_arm:
        raise MotorsRefused(f"{drone.uri} is armed: disarm it, then start again")
