"""What a search comes to: names that hold, and for what had to be given up, a search that goes on without it.

A cause that no name fits makes the nearest one grow until it is refused (at a bound, other in hard flying,
gone on other flights). Were that the end, what it stood in for would have no place in the model at all.
"""

import dataclasses
from collections.abc import Sequence

import numpy as np

from calibration.gap.data.record import FlightRecord
from calibration.gap.estimate.model import Model
from calibration.gap.estimate.refine import Training
from calibration.gap.search.forward import Search, search, search_on
from calibration.gap.search.naming import Named, as_believed, name_effects
from calibration.gap.search.retest import retested
from calibration.gap.search.rigid_body import as_a_rigid_body
from calibration.gap.search.selection import Progress, SearchContext

_MOST_TIMES = 2
"""A search goes on: each takes as long as a round or two."""


def concluded(
    model: Model,
    training: Training,
    kept_back: Sequence[FlightRecord],
    rng: np.random.Generator,
    progress: Progress = lambda _: None,
) -> tuple[Search, Named]:
    """Search for what a model lacks, and name it.

    Args:
        model: to begin with.
        training: flights to fit to.
        kept_back: flights that no fit sees, on which names must hold.
        rng: of the bootstrap.
        progress: told what is being looked at.
    """
    context = SearchContext(training, rng, progress)
    found = _held(search(model, context), training, kept_back)
    names = name_effects(found, training)
    for _ in range(_MOST_TIMES):
        if not names.given_up:
            break
        progress(f"without {', '.join(names.given_up)}")
        # What was given up the first time does not come back the second.
        context = dataclasses.replace(context, barred={**context.barred, **names.given_up})
        present = as_believed(found, names, training)
        on = search_on(found, present, context)
        if on.final.model.effects == present.model.effects and on.final.unnamed == present.unnamed:
            break
        found = _held(on, training, kept_back)
        names = name_effects(found, training)
    return found, names


def _held(found: Search, training: Training, kept_back: Sequence[FlightRecord]) -> Search:
    """The search with what holds on flights that were kept back, and is a vehicle."""
    held = retested(found, kept_back, training)
    return dataclasses.replace(held, final=as_a_rigid_body(held.final, training))
