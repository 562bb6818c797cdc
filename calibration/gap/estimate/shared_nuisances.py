"""Nuisances that all flights share: such a mean is no flight's own, and something explains it."""

from typing import NamedTuple

import numpy as np

from calibration.gap.data.signals import PARTS
from calibration.gap.estimate.nuisances import NUISANCES, Nuisance
from calibration.gap.estimate.refine import Fitted
from onboard.arrays import FloatArray
from onboard.gravity import GRAVITY
from onboard.vehicle import Vehicle

_STANDARD_ERRORS = 4.0

_LEAST_SCALE, _LEAST_BIAS, _LEAST_IMBALANCE = 0.02, 0.15, 0.01
"""Means over flights that have a consequence: of the scale of thrust, of a force (m/s2: 1.5 % of gravity),
and of a torque, as the share of one rotor's hover thrust that makes it."""


class SharedNuisance(NamedTuple):
    """A nuisance whose mean over flights is beyond chance, and has a consequence.

    Attributes:
        nuisance: which.
        mean, error: over flights, and its standard error, in the nuisance's unit.
    """

    nuisance: Nuisance
    mean: float
    error: float


def shared_nuisances(fitted: Fitted, vehicle: Vehicle) -> tuple[SharedNuisance, ...]:
    """What all flights share and the model does not say; empty for a single flight."""
    per_flight = fitted.estimate.fit.per_part.reshape(-1, PARTS, len(NUISANCES)).mean(axis=1)
    count = per_flight.shape[0]
    if count < 2:
        return ()
    means = per_flight.mean(axis=0).tolist()
    errors = (per_flight.std(axis=0, ddof=1) / np.sqrt(count)).tolist()
    return tuple(
        SharedNuisance(nuisance, mean, error)
        for nuisance, mean, error, least in zip(NUISANCES, means, errors, _least(vehicle), strict=True)
        if abs(mean) > max(_STANDARD_ERRORS * error, least)
    )


def _least(vehicle: Vehicle) -> FloatArray:
    """Mean of each nuisance that has a consequence; that of the battery's charge has none."""
    body = vehicle.body
    rotor = _LEAST_IMBALANCE * 0.25 * GRAVITY * body.mass.value
    torques = (
        rotor * body.arm_y.value / body.inertia_xx.value,
        rotor * body.arm_x.value / body.inertia_yy.value,
        rotor * vehicle.motors.thrust_to_torque.value / body.inertia_zz.value,
    )
    return np.array([_LEAST_SCALE, _LEAST_BIAS, _LEAST_BIAS, *torques, np.inf, np.inf])
