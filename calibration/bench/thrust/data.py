"""Points of thrust against motor voltage, ready for a fit."""

from dataclasses import dataclass, replace

import numpy as np

from calibration.bench.thrust.errors import ThrustTableError
from onboard.arrays import FloatArray

FEWEST_POINTS = 8


@dataclass(frozen=True, slots=True)
class ThrustData:
    """Settled points of one motor (or the mean of four).

    Attributes:
        name: of the table, for messages.
        source: where the numbers come from.
        voltage: (n,) V at the motor: duty really applied times the supply.
        thrust: (n,) N of one motor.
        block: (n,) label of the sweep or supply voltage a point belongs to: points of one block share errors.
        sigma_voltage: V, standard uncertainty of one voltage.
        sigma_thrust: N, of one thrust; None when the data must tell.
        shared: (n, k) how k common errors (tare readings) enter each thrust, in N; empty without any.
    """

    name: str
    source: str
    voltage: FloatArray
    thrust: FloatArray
    block: FloatArray
    sigma_voltage: float = 0.0
    sigma_thrust: float | None = None
    shared: FloatArray | None = None

    def __post_init__(self) -> None:
        if not self.voltage.shape == self.thrust.shape == self.block.shape or self.voltage.ndim != 1:
            raise ThrustTableError(
                f"{self.name}: {self.voltage.size} voltages for {self.thrust.size} thrusts"
            )
        if self.voltage.size < FEWEST_POINTS:
            raise ThrustTableError(
                f"{self.name}: {self.voltage.size} points; a map needs at least {FEWEST_POINTS}, better 20"
            )
        if not (np.all(np.isfinite(self.voltage)) and np.all(np.isfinite(self.thrust))):
            raise ThrustTableError(f"{self.name}: a voltage or thrust that is not a number")

    def chosen(self, rows: FloatArray) -> "ThrustData":
        """The points `rows` (indices or mask) only; at least as many as a fit needs must be left."""
        shared = None if self.shared is None else self.shared[rows]
        return replace(
            self, voltage=self.voltage[rows], thrust=self.thrust[rows], block=self.block[rows], shared=shared
        )
