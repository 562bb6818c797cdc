"""Nuisances that are none: a mean or a course within a flight that all flights share, and what is too large
for any flight to have of its own. Something explains it."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from calibration.gap.data.signals import PARTS
from calibration.gap.estimate.nuisances import NUISANCES
from calibration.gap.estimate.refine import Fitted
from onboard.arrays import FloatArray
from onboard.gravity import GRAVITY
from onboard.vehicle import Vehicle

_STANDARD_ERRORS = 4.0

_LEAST_SCALE, _LEAST_BIAS, _LEAST_IMBALANCE = 0.02, 0.15, 0.01
"""Means over flights that have a consequence: of the scale of thrust, of a force (m/s2: 1.5 % of gravity),
and of a torque, as the share of one rotor's hover thrust that makes it."""

_ORDINARY, _ORDINARY_YAW = 10.0, 50.0
"""Such means that single flights may have, root mean square: a fifth of the thrust, a tenth of a rotor's
torque in hover, and half of it about b_z, where that is next to nothing and a rotor that leans turns as much.
A vehicle that tips over at take-off has a torque of its own in every flight."""

_LEAST_COURSES = {"thrust_scale": 0.01, "force_bias_x": 0.1, "force_bias_y": 0.1}
"""Nuisances in the first part of a flight less those in the others, on average: each 5 cm after 1 s."""


class SharedNuisance(NamedTuple):
    """A nuisance, or its course within a flight, and what flights share of it.

    Attributes:
        mean, error: over flights, and its standard error.
        least: mean that has a consequence.
        beyond_chance: whether the mean is, and has a consequence.
    """

    name: str
    unit: str
    mean: float
    error: float
    least: float
    beyond_chance: bool


def shared_nuisances(fitted: Fitted, vehicle: Vehicle) -> tuple[SharedNuisance, ...]:
    """What all flights share and the model does not say; empty for a single flight."""
    return tuple(one for one in every_mean(fitted, vehicle) if one.beyond_chance)


def every_mean(fitted: Fitted, vehicle: Vehicle) -> tuple[SharedNuisance, ...]:
    """The means over flights of all nuisances and their courses, whether beyond chance or not."""
    names = [(nuisance.name, nuisance.unit) for nuisance in NUISANCES]
    return (*_means(names, _by_part(fitted).mean(axis=1), _least(vehicle)), *_courses(fitted))


def _courses(fitted: Fitted) -> tuple[SharedNuisance, ...]:
    """Forces, where their parts do not merely scatter about their flight's own: all begin alike.

    The first part is held against the others: what warms, relaxes or settles does so most at first, and what
    grows is least then.
    """
    forces = [index for index, nuisance in enumerate(NUISANCES) if nuisance.name in _LEAST_COURSES]
    parts = _by_part(fitted)[:, :, forces]
    begun = parts[:, 0] - parts[:, 1:].mean(axis=1)
    names = [(f"{NUISANCES[index].name} at first", NUISANCES[index].unit) for index in forces]
    return _means(names, begun, np.array([_LEAST_COURSES[NUISANCES[index].name] for index in forces]))


def beyond_the_ordinary(fitted: Fitted, vehicle: Vehicle) -> tuple[tuple[str, float, str], ...]:
    """Nuisances without a shared mean that are larger than any flight's own: name, rms over flights, unit."""
    shared = {one.name for one in shared_nuisances(fitted, vehicle)}
    sizes = np.sqrt(np.mean(_by_part(fitted).mean(axis=1) ** 2, axis=0))
    times = [_ORDINARY_YAW if one.name == "torque_trim_z" else _ORDINARY for one in NUISANCES]
    found = zip(NUISANCES, sizes.tolist(), (np.array(times) * _least(vehicle)).tolist(), strict=True)
    large = [(one, size) for one, size, most in found if size > most]
    return tuple((one.name, size, one.unit) for one, size in large if one.name not in shared)


def swallowed(fitted: Fitted, other: Fitted) -> tuple[str, ...]:
    """Nuisances that take, on average over the flights, what `fitted` explains and `other` does not.

    Each part of a flight has nuisances of its own, which cost little likelihood: a thrust that is weak on all
    flights would pass for their scatter where sharper signals decide.
    """
    explained = {shared.name for shared in shared_nuisances(fitted, fitted.model.base)}
    taken = (shared.name for shared in shared_nuisances(other, other.model.base))
    return tuple(name for name in taken if name not in explained)


def _by_part(fitted: Fitted) -> FloatArray:
    """Nuisances, shape (flights, parts, nuisances)."""
    return fitted.estimate.fit.per_part.reshape(-1, PARTS, len(NUISANCES))


def _means(
    names: Sequence[tuple[str, str]], of_flights: FloatArray, least: FloatArray
) -> tuple[SharedNuisance, ...]:
    """Means of columns, shape (flights, n); those of one flight may all be chance."""
    count = of_flights.shape[0]
    means = of_flights.mean(axis=0)
    errors = of_flights.std(axis=0, ddof=1) / np.sqrt(count) if count > 1 else np.full(means.size, np.inf)
    beyond = np.abs(means) > np.maximum(_STANDARD_ERRORS * errors, least)
    return tuple(
        SharedNuisance(name, unit, mean, error, smallest, large)
        for (name, unit), mean, error, smallest, large in zip(
            names, means.tolist(), errors.tolist(), least.tolist(), beyond.tolist(), strict=True
        )
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
