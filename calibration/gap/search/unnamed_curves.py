"""What has no name, for the vehicle file: curves that hold on flights that no fit saw."""

from collections.abc import Sequence
from dataclasses import dataclass

from calibration.gap.data.record import FlightRecord
from calibration.gap.estimate.model import Model
from calibration.gap.estimate.refine import Fitted, training_set
from calibration.gap.search.naming import Named, not_loaded
from calibration.gap.search.retest import FAILED, on_unseen
from calibration.gap.unnamed.curves import WordedTerm, worded_terms
from onboard.vehicle.unnamed import MOST_CURVES, UnnamedCurve

NO_FLIGHT = "no flight was kept back to hold it against"
NO_ROOM = f"a vehicle file holds no more than {MOST_CURVES} of them"
UNCONFIRMED = "fewer flights were fitted than confirm anything"


@dataclass(frozen=True)
class UnnamedCurves:
    """Terms without a name of a fit.

    Attributes:
        curves: those that the vehicle file gets, by what they are in words.
        refused: why it does not get the others.
    """

    curves: dict[str, UnnamedCurve]
    refused: dict[str, str]

    def without_any(self, reason: str) -> "UnnamedCurves":
        """The same without a curve, each refused for one reason."""
        return UnnamedCurves({}, {**self.refused, **dict.fromkeys(self.curves, reason)})


def unnamed_curves(
    names: Named, believed: Fitted, kept_back: Sequence[FlightRecord], source: str
) -> UnnamedCurves:
    """Terms without a name that a vehicle file can say and flights kept back bear out.

    Nobody knows a physics that speaks for such a term: it has to make flights that no fit saw more likely,
    where a name must only not make them less likely.

    Args:
        names: what was named.
        believed: the fit with these names and all terms without one.
        kept_back: flights that no fit saw.
        source: provenance of the numbers, for the file.
    """
    terms = list(worded_terms(believed, names.improved.parameters(), source))
    refused: dict[str, str] = {}
    curves: dict[str, UnnamedCurve] = {}
    for one in terms:
        why_not = one.why_not or _cannot_be_written(one, names, bool(kept_back), len(curves))
        if why_not:
            refused[one.formula] = why_not
        elif one.curve is not None:
            curves[one.formula] = one.curve
    held = _that_hold(curves, believed, kept_back)
    refused.update({formula: FAILED for formula in curves if formula not in held})
    return UnnamedCurves(held, refused)


def _cannot_be_written(one: WordedTerm, names: Named, kept_back: bool, present: int) -> str:
    """Why a term's curve does not even come into question; empty where it does."""
    if names.unconfirmed:
        return UNCONFIRMED
    if not kept_back:
        return NO_FLIGHT
    if len(names.improved.base.unnamed) + present >= MOST_CURVES:
        return NO_ROOM
    curves = () if one.curve is None else (one.curve,)
    problem = not_loaded(names.improved.with_curves(curves).vehicle())
    return f"no vehicle file can say it: {problem}" if problem else ""


def _that_hold(
    curves: dict[str, UnnamedCurve], believed: Fitted, kept_back: Sequence[FlightRecord]
) -> dict[str, UnnamedCurve]:
    """Those without which flights kept back are less likely, the last one found asked first."""
    if not curves:
        return curves
    unseen = training_set(kept_back, Model(believed.model.base, {}, believed.model.ceiling_z))
    present = dict(curves)
    for formula in reversed(curves):
        rest = {other: curve for other, curve in present.items() if other != formula}
        with_it, without_it = (
            on_unseen(unseen, believed.model.with_curves(some.values()), believed, believed)
            for some in (present, rest)
        )
        if float(with_it.gains(without_it, in_time=False).sum()) <= 0.0:
            present = rest
    return present
