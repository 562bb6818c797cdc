"""What differs from flight to flight and is nobody's fault: scale of thrust, bias, trim, state of charge.

Each part of a flight has its own values, drawn from normal distributions whose spread is estimated with
everything else (random effects). Their mean is no nuisance: that is what effects are for. A scale of thrust
belongs to an airframe first, and its parts scatter about the flight's own. Otherwise flights of several
airframes would let every part have any scale, and a thrust that falls in all flights would pass for scatter.
"""

import math
from typing import NamedTuple

import numpy as np

from calibration.gap.data.signals import CHANNELS, FORCE, Signals
from onboard.arrays import FloatArray


class Spread(NamedTuple):
    """Standard deviation of a nuisance.

    Attributes:
        first: that is assumed at first.
        least: the smallest that is believed.
        most: the largest; what is beyond three times this is not one of these vehicles.
    """

    first: float
    least: float
    most: float


class Nuisance(NamedTuple):
    """One value per part of a flight.

    Attributes:
        parts: spread over parts of flights.
        flights: spread over flights of the value about which their parts scatter; None: about zero.
    """

    name: str
    unit: str
    parts: Spread
    flights: Spread | None = None

    @property
    def first(self) -> float:
        """Standard deviation in one part of one flight that is assumed at first."""
        return self.parts.first if self.flights is None else math.hypot(self.parts.first, self.flights.first)


NUISANCES = (
    Nuisance("thrust_scale", "1", Spread(0.005, 1e-3, 0.05), Spread(0.01, 5e-3, 0.05)),
    Nuisance("force_bias_x", "m/s2", Spread(0.05, 5e-3, 0.5), Spread(0.02, 5e-3, 0.5)),
    Nuisance("force_bias_y", "m/s2", Spread(0.05, 5e-3, 0.5), Spread(0.02, 5e-3, 0.5)),
    Nuisance("torque_trim_x", "rad/s2", Spread(1.0, 0.1, 20.0), Spread(0.5, 0.1, 20.0)),
    Nuisance("torque_trim_y", "rad/s2", Spread(1.0, 0.1, 20.0), Spread(0.5, 0.1, 20.0)),
    Nuisance("torque_trim_z", "rad/s2", Spread(0.5, 0.05, 10.0), Spread(0.2, 0.05, 10.0)),
    Nuisance("open_circuit", "V", Spread(0.1, 1e-2, 1.0)),
    Nuisance("discharge", "V/s", Spread(1e-3, 1e-4, 2e-2)),
)
"""Scale of thrust (propellers), bias of the accelerometer or tilt, torque trim, battery."""

STEADY = tuple(index for index, nuisance in enumerate(NUISANCES) if nuisance.flights is not None)
"""Nuisances of which a flight has a value of its own, about which those of its parts scatter."""

SPREADS = (*(n.parts for n in NUISANCES), *(n.flights for n in NUISANCES if n.flights is not None))
"""Of the nuisances over parts, then of the steady ones over flights."""


def nuisance_columns(signals: Signals, predicted: FloatArray) -> FloatArray:
    """Signals per unit of each nuisance, shape (nuisances, n, 7); each row belongs to its own part."""
    # In the order in which channels are whitened, one after the other.
    columns = np.zeros((len(NUISANCES), len(CHANNELS), signals.valid.shape[0])).swapaxes(1, 2)
    columns[0][:, FORCE] = predicted[:, FORCE]
    columns[1][:, 0] = columns[2][:, 1] = 1.0
    for axis in range(3):
        columns[3 + axis][:, 3 + axis] = 1.0
    columns[6][:, 6] = 1.0
    middle = 0.5 * (signals.part_bounds[:-1] + signals.part_bounds[1:])
    columns[7][:, 6] = signals.dt * (np.arange(signals.valid.shape[0]) - middle[signals.part])
    return columns
