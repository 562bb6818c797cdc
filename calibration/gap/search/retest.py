"""The last question to every name: do flights that no fit saw get more likely with it?"""

import dataclasses
from collections.abc import Sequence

import numpy as np

from calibration.gap.data.excitation import commanded, only_excited
from calibration.gap.data.record import FlightRecord
from calibration.gap.data.signals import TORQUE
from calibration.gap.estimate.model import Model
from calibration.gap.estimate.refine import Fitted, Training, refine, training_set
from calibration.gap.estimate.regression import Regression
from calibration.gap.estimate.shared_nuisances import every_mean, swallowed
from calibration.gap.search.always import LOG_TIMING
from calibration.gap.search.forward import Search
from calibration.gap.search.rivals import nearly_without, without

FAILED = "flights that were kept back are predicted worse with it"

_WORSE = -2.0
"""Log-likelihood of flights kept back: what falls by more does not hold. Those that do not excite an effect
say nothing about it."""


def retested(found: Search, kept_back: Sequence[FlightRecord], training: Training) -> Search:
    """The search without effects that do not hold on flights that were kept back, the others fitted anew."""
    if not kept_back:
        return found
    unseen = unseen_set(kept_back, found.first.model, training)
    for step in reversed(found.steps):
        if step.effect == LOG_TIMING.effect or _holds(
            found.final, nearly_without(found.final, training, step.effect), unseen
        ):
            continue
        reduced = without(found.final, training, step.effect)
        if not _holds(found.final, reduced, unseen):  # not only with derivatives of a model near by
            found = dataclasses.replace(
                found,
                final=reduced,
                steps=tuple(one for one in found.steps if one.effect != step.effect),
                refused={**found.refused, step.effect: FAILED},
            )
    return found


def unseen_set(kept_back: Sequence[FlightRecord], model: Model, training: Training) -> Training:
    """Flights that no fit saw, of whose torques those count that somebody commanded.

    Beside hard flights what answers noise has no say; by themselves quiet ones would refuse a lag that the
    others show beyond doubt. How quiet quiet is, those tell that were fitted: one flight of shakes is none.
    """
    unseen = training_set(kept_back, Model(model.base, {}, model.ceiling_z), training.quiet)
    weights = only_excited(unseen.regression.weights)
    return dataclasses.replace(unseen, regression=Regression(unseen.regression.signals, weights))


def _holds(final: Fitted, reduced: Fitted, unseen: Training) -> bool:
    """Whether flights that no fit saw speak for what a fit has more than another."""
    unseen = where_it_shows(unseen, final.model, reduced.model)
    # Under one noise: that of a model which lacks something is broader, and forgives a harder flight more.
    with_it, without_it = (on_unseen(unseen, one.model, final, one) for one in (final, reduced))
    if shared := swallowed(final, reduced):
        return shared_by(with_it, without_it, shared)
    return float(with_it.gains(without_it, in_time=False).sum()) >= _WORSE


def where_it_shows(unseen: Training, model: Model, other: Model) -> Training:
    """The flights, of whose torques those parts count in which two models differ by more than may be answers.

    That share of what is commanded, 1 less the weight of the part, makes what turns the vehicle look weaker
    or stronger than it is: eights, twenty times as excited as hover, told of nothing where an inertia was a
    sixth smaller than its file said.
    """
    signals, weights = unseen.regression.signals, unseen.regression.weights.copy()
    predicted, without_it = (one.predict(unseen.records) for one in (model, other))
    differ = commanded(signals, predicted - without_it)
    answers = (1.0 - weights[:, TORQUE]) ** 2 * commanded(signals, without_it)
    weights[:, TORQUE] = np.where(differ > answers, weights[:, TORQUE], 0.0)
    return dataclasses.replace(unseen, regression=Regression(signals, weights))


def shared_by(with_it: Fitted, without_it: Fitted, names: Sequence[str]) -> bool:
    """Whether flights that no fit saw need less of each of these nuisances with an effect than without it, or
    so little that it has no consequence.

    What all flights share shows in nuisances, and whitened noise tells little of it: of three flights the
    likelihood may fall by chance.
    """
    less, more = ({one.name: one for one in every_mean(fit, fit.model.base)} for fit in (with_it, without_it))
    return all(abs(less[name].mean) < max(abs(more[name].mean), less[name].least) for name in names)


def on_unseen(unseen: Training, model: Model, noise_of: Fitted, unstated_of: Fitted) -> Fitted:
    """A model held against other flights, whose nuisances are integrated out.

    Args:
        unseen: the flights.
        model: that is held against them.
        noise_of: fit whose noise they have.
        unstated_of: fit that tells what no vehicle file states.
    """
    known = unstated_of.known_of_unstated
    return refine(model, (), unseen, iterations=1, start=noise_of, unnamed=(), known_of_unstated=known)
