"""The drone's gyroscope, accelerometer and battery at 100 Hz, with the drone's own time stamps.

The arrival time at the host jitters by 3 to 10 ms (note bench.md, section 1.1), the drone's stamp by 1 ms.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from calibration.bench.instruments.drone_log import PERIOD_MS, DroneLog, refuse_armed
from onboard.closing import Closing
from onboard.gravity import GRAVITY
from onboard.link import DroneLink

#: One block: 6 floats and one u16, 26 bytes, all that a packet holds.
_NAMES = ("gyro.x", "gyro.y", "gyro.z", "acc.x", "acc.y", "acc.z", "pm.vbatMV")


@dataclass(frozen=True, slots=True)
class GyroBatch:
    """Samples since the last look.

    Attributes:
        times: (n,), drone time since its boot, wraps undone [s].
        receipts: (n,), host clock [s].
        rates: (n, 3), body rates [rad/s].
        accelerations: (n, 3), specific force, body [m/s2]; at rest and upright +9.8 along z.
        voltages: (n,), battery [V].
        lost: samples missing within, and between this batch and the one before.
    """

    times: NDArray[np.float64]
    receipts: NDArray[np.float64]
    rates: NDArray[np.float64]
    accelerations: NDArray[np.float64]
    voltages: NDArray[np.float64]
    lost: int


class GyroRecorder(Closing):
    """A running recording; a context manager. Refuses to start while the motors are armed."""

    def __init__(self, drone: DroneLink) -> None:
        """Start the log block.

        Raises:
            MotorsRefused: armed or flying. NoSuchVariable, LinkTimeout, LinkLost.
        """
        refuse_armed(drone)
        self._log = DroneLog(drone, _NAMES, PERIOD_MS)

    @property
    def overrun(self) -> int:
        """Samples that this program was too slow for."""
        return self._log.overrun

    def check(self) -> None:
        """Raise LinkLost or InstrumentLost when samples no longer come."""
        self._log.check()

    def take(self, within_s: float = 1.0) -> GyroBatch:
        """Samples since the last call; waits up to `within_s` [s, at most 1] for the first.

        Raises:
            LinkLost, InstrumentLost: samples no longer come.
        """
        batch = self._log.take(within_s)
        columns = [batch.values[name] for name in _NAMES]
        return GyroBatch(
            batch.times,
            batch.receipts,
            math.pi / 180.0 * np.stack(columns[0:3], axis=1),
            GRAVITY * np.stack(columns[3:6], axis=1),
            1e-3 * columns[6],
            batch.lost,
        )

    def close(self) -> None:
        """End the recording; idempotent."""
        self._log.close()


def join(batches: list[GyroBatch]) -> GyroBatch:
    """One batch from several in order, at least one."""
    return GyroBatch(
        np.concatenate([batch.times for batch in batches]),
        np.concatenate([batch.receipts for batch in batches]),
        np.concatenate([batch.rates for batch in batches]),
        np.concatenate([batch.accelerations for batch in batches]),
        np.concatenate([batch.voltages for batch in batches]),
        sum(batch.lost for batch in batches),
    )
