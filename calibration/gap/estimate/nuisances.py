"""What differs from flight to flight and is nobody's fault: scale of thrust, bias, trim, state of charge.

Each part of a flight has its own values, drawn from normal distributions whose spread is estimated with
everything else (random effects). Their mean is no nuisance: that is what effects are for. A scale of thrust
belongs to an airframe first, and its parts scatter about the flight's own. Otherwise flights of several
airframes would let every part have any scale, and a thrust that falls in all flights would pass for scatter.
"""

from typing import NamedTuple

import numpy as np

from calibration.gap.data.signals import CHANNELS, FORCE, Signals
from onboard.arrays import FloatArray


class Nuisance(NamedTuple):
    """One value per flight.

    Attributes:
        name: what it is.
        unit: of its value.
        spread: standard deviation over flights that is assumed at first.
        least: smallest standard deviation that is believed.
        most: largest; a flight beyond three times this is not one of these vehicles.
    """

    name: str
    unit: str
    spread: float
    least: float
    most: float


NUISANCES = (
    Nuisance("thrust_scale", "1", 0.005, 1e-3, 0.05),
    Nuisance("force_bias_x", "m/s2", 0.05, 5e-3, 0.5),
    Nuisance("force_bias_y", "m/s2", 0.05, 5e-3, 0.5),
    Nuisance("torque_trim_x", "rad/s2", 1.0, 0.1, 20.0),
    Nuisance("torque_trim_y", "rad/s2", 1.0, 0.1, 20.0),
    Nuisance("torque_trim_z", "rad/s2", 0.5, 0.05, 10.0),
    Nuisance("open_circuit", "V", 0.1, 1e-2, 1.0),
    Nuisance("discharge", "V/s", 1e-3, 1e-4, 2e-2),
)
"""Per flight: scale of thrust (propellers), bias of the accelerometer or tilt, torque trim, battery."""


STEADY = (0,)
"""Nuisances of which a flight has a value of its own, about which those of its parts scatter."""

STEADY_SPREADS = ((0.01, 1e-3, 0.1),)
"""Of each of them over flights: the spread assumed at first, the smallest and the largest believed."""


def nuisance_columns(signals: Signals, predicted: FloatArray) -> FloatArray:
    """Signals per unit of each nuisance, shape (nuisances, n, 7); each row belongs to its own part."""
    columns = np.zeros((len(NUISANCES), signals.valid.shape[0], len(CHANNELS)))
    columns[0][:, FORCE] = predicted[:, FORCE]
    columns[1][:, 0] = columns[2][:, 1] = 1.0
    for axis in range(3):
        columns[3 + axis][:, 3 + axis] = 1.0
    columns[6][:, 6] = 1.0
    middle = 0.5 * (signals.part_bounds[:-1] + signals.part_bounds[1:])
    columns[7][:, 6] = signals.dt * (np.arange(signals.valid.shape[0]) - middle[signals.part])
    return columns
