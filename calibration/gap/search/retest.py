"""The last question to every name: do flights that no fit saw get more likely with it?"""

import dataclasses
from collections.abc import Sequence

from calibration.gap.data.record import FlightRecord
from calibration.gap.estimate.model import Model
from calibration.gap.estimate.refine import Fitted, Training, refine, training_set
from calibration.gap.search.forward import LOG_TIMING, Search
from calibration.gap.search.rivals import without

FAILED = "flights that were kept back are predicted worse with it"

_WORSE = -2.0
"""Log-likelihood of flights kept back: what falls by more does not hold. Those that do not excite an effect
say nothing about it."""


def retested(found: Search, kept_back: Sequence[FlightRecord], training: Training) -> Search:
    """The search without effects that do not hold on flights that were kept back, the others fitted anew."""
    if not kept_back:
        return found
    unseen = training_set(kept_back, Model(found.first.model.base, {}, found.first.model.ceiling_z))
    for step in reversed(found.steps):
        reduced = without(found.final, training, step.effect)
        with_it, without_it = (on_unseen(unseen, one, one.model) for one in (found.final, reduced))
        gain = float(with_it.gains(without_it, in_time=False).sum())
        if step.effect != LOG_TIMING.effect and gain < _WORSE:
            found = dataclasses.replace(
                found,
                final=reduced,
                steps=tuple(one for one in found.steps if one.effect != step.effect),
                refused={**found.refused, step.effect: FAILED},
            )
    return found


def on_unseen(unseen: Training, fitted: Fitted, model: Model) -> Fitted:
    """A model held against other flights, whose nuisances are integrated out, with the noise of a fit."""
    return refine(model, (), unseen, iterations=1, start=fitted.estimate)
