"""What has no name, for the vehicle file: curves that hold on flights that no fit saw."""

import dataclasses
from collections.abc import Sequence

from calibration.gap.data.record import FlightRecord
from calibration.gap.estimate.model import Model
from calibration.gap.estimate.refine import Fitted, Training, training_set
from calibration.gap.search.naming import Named, not_loaded
from calibration.gap.search.retest import FAILED, held_against
from calibration.gap.unnamed.curves import WordedTerm, worded_terms
from onboard.vehicle.unnamed import MOST_CURVES, UnnamedCurve

NO_FLIGHT = "no flight was kept back to hold it against"
NO_ROOM = f"a vehicle file holds {MOST_CURVES} of them"


def with_curves(
    names: Named, believed: Fitted, kept_back: Sequence[FlightRecord], training: Training, source: str
) -> Named:
    """The names, with the terms without a name that a vehicle file can say and flights bear out.

    Nobody knows a physics that speaks for such a term: it has to make flights that no fit saw more likely,
    where a name must only not make them less likely.

    Args:
        names: what was named.
        believed: the fit with these names and all terms without one.
        kept_back: flights that no fit saw.
        training: flights of the fit.
        source: provenance of the numbers, for the file.
    """
    if names.unconfirmed:
        return names
    terms = list(worded_terms(believed, names.improved.parameters(), source))
    present: list[WordedTerm] = []
    refused: dict[str, str] = {}
    given = names.improved.base.unnamed
    for one in terms:
        why_not = one.why_not
        if one.curve is not None and not kept_back:
            why_not = NO_FLIGHT
        elif one.curve is not None and len(given) + len(present) == MOST_CURVES:
            why_not = NO_ROOM
        elif one.curve is not None:
            why_not = not_loaded(_with(names.improved, [one]).vehicle()) or ""
        if why_not:
            refused[one.formula] = why_not
        else:
            present.append(one)
    if present:
        unseen = training_set(kept_back, Model(believed.model.base, {}, believed.model.ceiling_z))
        for one in reversed(tuple(present)):
            rest = [other for other in present if other is not one]
            fits = (held_against(unseen, believed, _with(believed.model, some)) for some in (present, rest))
            with_it, without_it = fits
            if float(with_it.gains(without_it, in_time=False, kinds=_KINDS[one.kind]).sum()) <= 0.0:
                refused[one.formula] = FAILED
                present = rest
    return names.with_unnamed(...)
