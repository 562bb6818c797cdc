"""What is left when all names are in the model, and where: without it there is no verdict but this one."""

import math
from collections.abc import Iterator

import numpy as np

from calibration.gap.data.channels import attitudes
from calibration.gap.data.signals import FORCE
from calibration.gap.estimate.mixed import FIRST_SPREAD
from calibration.gap.estimate.nuisances import NUISANCES, STEADY
from calibration.gap.estimate.refine import Fitted, Training
from calibration.gap.estimate.shared_nuisances import beyond_the_ordinary, shared_nuisances
from calibration.gap.report.document import Gap
from calibration.gap.report.prediction_figures import HORIZON
from calibration.gap.unnamed.consequence import least_amplitude
from calibration.gap.unnamed.gap_map import GapMap
from calibration.gap.unnamed.structure import LEVEL
from onboard.gravity import GRAVITY
from onboard.vehicle import Vehicle

_TIMES = 2.0
"""Errors below this many floors are the flights' own."""

_DEVIATIONS = 3.0
"""Standard deviations of what the flights kept back have of their own on average that leave a healthy model
below :data:`_TIMES` floors."""

_FORCE_OF = {"thrust_scale": GRAVITY, "force_bias_x": 1.0, "force_bias_y": 1.0}
"""Force (m/s2) in hover per unit of a nuisance."""

_HALF = 0.5
"""Share of the error above the floor that names must close; of a channel that no place may hold."""


def chance_floor(final: Fitted, training: Training) -> float:
    """Mean position error (m) that forces of chance make in :data:`HORIZON`: what a fit leaves, integrated.

    What each part of a flight has of its own is taken out, and so are names; structure in the rest is looked
    for elsewhere.
    """
    signals = training.regression.signals
    turns = attitudes(training.records)
    force = np.einsum("nij,nj->ni", turns, final.estimate.residual[:, FORCE])
    valid = np.asarray(signals.valid[:, FORCE].all(axis=1))
    size = round(HORIZON / signals.dt)
    weights = signals.dt * (HORIZON - signals.dt * (np.arange(size) + 0.5))
    errors = [
        float(np.linalg.norm(weights @ force[first : first + size]))
        for flight in range(signals.flights)
        for first in range(int(signals.bounds[flight]), int(signals.bounds[flight + 1]) - size, size // 2)
        if valid[first : first + size].all()
    ]
    return float(np.mean(errors)) if errors else 0.0


def own_floor(final: Fitted, kept_back: int) -> float:
    """Position error (m) that kept-back flights make in :data:`HORIZON` by what each has of its own.

    Scale of thrust and bias differ from flight to flight (random effects), and no model knows those of a
    flight that it has not seen: of few flights kept back, one that lifts 1.5 % less than the others says
    nothing about a model. Beyond what is ordinary they are a gap.
    """
    ordinary = np.minimum(final.estimate.fit.spread, FIRST_SPREAD)
    spreads = zip((*NUISANCES, *(NUISANCES[index] for index in STEADY)), ordinary, strict=True)
    forces = [spread * _FORCE_OF[nuisance.name] for nuisance, spread in spreads if nuisance.name in _FORCE_OF]
    few = max(1.0, _DEVIATIONS / (_TIMES * math.sqrt(kept_back)))
    return few * 0.5 * HORIZON**2 * math.hypot(*forces)


def remaining(
    gap: Gap, chance: float, final: Fitted, after: GapMap, vehicle: Vehicle, named: bool
) -> tuple[str, ...]:
    """Sentences on what is left; none where names, sensors and chance account for the flights.

    `chance` (m) is from :func:`chance_floor` and :func:`own_floor`; `after`: where the residual of
    the `final` fit lives; `named`: whether anything has a name.
    """
    return (*_error(gap, chance, named), *_places(after, vehicle), *_nuisances(final, vehicle))


def _error(gap: Gap, chance: float, named: bool) -> Iterator[str]:
    levels = gap.overall
    floor = float(np.hypot(levels.noise_floor or 0.0, chance))
    removable = levels.before - floor
    closed = (levels.before - levels.after) / removable if removable > 0.0 else 1.0
    if levels.after > _TIMES * floor and not (named and closed >= _HALF):
        yield (
            f"{gap.metric}: {levels.after:.3g} {levels.unit}, where sensors and chance leave {floor:.3g}; "
            f"{max(closed, 0.0):.0%} of what is above that has a name"
        )


def _places(after: GapMap, vehicle: Vehicle) -> Iterator[str]:
    seen = set()
    for cell in after.cells:
        channel = cell.channel
        large = np.sqrt(np.mean(cell.profile**2)) >= least_amplitude(channel, vehicle)
        if cell.share < _HALF or cell.p >= LEVEL or not large or channel.kind == "voltage":
            continue
        if channel.signal not in seen:
            seen.add(channel.signal)
            with_what = f"{cell.regressor.name} ({cell.condition})"
            yield f"{channel.name}: {cell.share:.0%} of what is left goes with {with_what}"


def _nuisances(final: Fitted, vehicle: Vehicle) -> Iterator[str]:
    for shared in shared_nuisances(final, vehicle):
        name = shared.name.replace("_", " ")
        yield f"{name}: {shared.mean:.3g} +- {shared.error:.2g} {shared.unit} in all flights"
    for name, size, unit in beyond_the_ordinary(final, vehicle):
        yield f"{name.replace('_', ' ')}: {size:.3g} {unit} rms over flights, more than any has of its own"
