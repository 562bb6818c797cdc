"""What is left when all names are in the model, and where: without it there is no verdict but this one."""

from collections.abc import Iterator

import numpy as np

from calibration.gap.data.channels import attitudes
from calibration.gap.data.signals import FORCE, PARTS
from calibration.gap.estimate.nuisances import NUISANCES
from calibration.gap.estimate.refine import Fitted, Training
from calibration.gap.report.document import Gap
from calibration.gap.unnamed.gap_map import GapMap
from calibration.gap.unnamed.structure import LEAST_AMPLITUDE, LEVEL
from onboard.arrays import FloatArray
from onboard.gravity import GRAVITY
from onboard.vehicle import Vehicle

_TIMES = 2.0
"""Errors below this many floors are the flights' own."""

_HALF = 0.5
"""Share of the error above the floor that names must close; of a channel that no place may hold."""

_STANDARD_ERRORS = 4.0

_LEAST_SCALE, _LEAST_BIAS, _LEAST_IMBALANCE = 0.02, 0.15, 0.01
"""Means over flights that have a consequence: of the scale of thrust, of a force (m/s2: 1.5 % of gravity),
and of a torque, as the share of one rotor's hover thrust that makes it."""


def chance_floor(final: Fitted, training: Training, horizon: float) -> float:
    """Mean position error (m) that the forces of chance make in `horizon` (s): what a fit leaves, integrated.

    What each part of a flight has of its own is taken out, and so are names; structure in the rest is looked
    for elsewhere.
    """
    signals = training.regression.signals
    turns = attitudes(training.records)
    force = np.einsum("nij,nj->ni", turns, final.estimate.residual[:, FORCE])
    valid = np.asarray(signals.valid[:, FORCE].all(axis=1))
    size = round(horizon / signals.dt)
    weights = signals.dt * (horizon - signals.dt * (np.arange(size) + 0.5))
    errors = [
        float(np.linalg.norm(weights @ force[first : first + size]))
        for flight in range(signals.flights)
        for first in range(int(signals.bounds[flight]), int(signals.bounds[flight + 1]) - size, size // 2)
        if valid[first : first + size].all()
    ]
    return float(np.mean(errors)) if errors else 0.0


def remaining(
    gap: Gap, chance: float, final: Fitted, after: GapMap, vehicle: Vehicle, named: bool
) -> tuple[str, ...]:
    """Sentences on what is left; none where names, sensors and chance account for the flights.

    Args:
        gap: on flights kept back.
        chance: m, from :func:`chance_floor`.
        final: the fit with all names.
        after: where its residual lives.
        vehicle: as given.
        named: whether anything has a name.
    """
    return (*_error(gap, chance, named), *_places(after), *_means(final, vehicle))


def _error(gap: Gap, chance: float, named: bool) -> Iterator[str]:
    levels = gap.overall
    floor = float(np.hypot(levels.noise_floor or 0.0, chance))
    removable = levels.before - floor
    closed = (levels.before - levels.after) / removable if removable > 0.0 else 1.0
    if levels.after > _TIMES * floor and not (named and closed >= _HALF):
        yield (
            f"{gap.metric}: {levels.after:.3g} {levels.unit}, where sensors and chance leave {floor:.3g}; "
            f"{max(closed, 0.0):.0%} of what is above that is explained"
        )


def _places(after: GapMap) -> Iterator[str]:
    seen = set()
    for cell in after.cells:
        channel = cell.channel
        large = np.sqrt(np.mean(cell.profile**2)) >= LEAST_AMPLITUDE[channel.kind]
        if cell.share < _HALF or cell.p >= LEVEL or not large or channel.kind == "voltage":
            continue
        if channel.signal not in seen:
            seen.add(channel.signal)
            with_what = f"{cell.regressor.name} ({cell.condition})"
            yield f"{channel.name}: {cell.share:.0%} of what is left goes with {with_what}"


def _means(final: Fitted, vehicle: Vehicle) -> Iterator[str]:
    """Nuisances that all flights share: no flight's own then."""
    per_flight = final.estimate.fit.per_part.reshape(-1, PARTS, len(NUISANCES)).mean(axis=1)
    count = per_flight.shape[0]
    if count < 2:
        return
    means = per_flight.mean(axis=0)
    errors = per_flight.std(axis=0, ddof=1) / np.sqrt(count)
    for nuisance, mean, error, least in zip(NUISANCES, means, errors, _least(vehicle), strict=True):
        if abs(mean) > max(_STANDARD_ERRORS * error, least):
            name = nuisance.name.replace("_", " ")
            yield f"{name}: {mean:.3g} +- {error:.2g} {nuisance.unit} in all flights"


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
