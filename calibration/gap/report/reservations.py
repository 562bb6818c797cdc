"""With what reservations a verdict is to be read, in words."""

from collections.abc import Iterator, Sequence

from calibration.gap.data.record import FlightRecord
from calibration.gap.estimate.refine import Training
from calibration.gap.search.always import law_in_words
from calibration.gap.search.differing import differing, in_words
from calibration.gap.search.forward import Search
from calibration.gap.search.naming import FEWEST, Named
from calibration.gap.unnamed.fitted_terms import FittedTerm, formulas
from onboard.vehicle import EFFECTS


def of_the_search(found: Search, names: Named) -> Iterator[str]:
    """What flights cannot tell of effects and laws, and what few of them do not confirm."""
    for name in found.blind:
        needed = EFFECTS[name].revealed_by
        yield f"{name} cannot be judged: even an ordinary one would not show; needed: {needed}"
    for name in names.unconfirmed:
        few = f"fewer than {FEWEST} were fitted"
        yield f"{name} explains these flights best, but {few}: fly more to confirm it"
    if found.first.model.ceiling_z is None and "ceiling_effect" in names.effects:
        yield (
            "ceiling_effect: nobody said how high the ceiling is; it was fitted at "
            f"{names.model.ceiling_z:.2f} m, and the parameters shift with it: give its height (--ceiling)"
        )
    yield from law_in_words(found.final)


def of_the_fit(found: Search, kept_back: Sequence[FlightRecord]) -> Iterator[str]:
    """Where intervals and errors are worth less than they look."""
    if not found.final.estimate.fit.settled:
        yield (
            "how much flights differ by themselves (thrust, trims, battery) could not be found to the end: "
            "the intervals are those of the last step"
        )
    if not kept_back:
        yield (
            "no flight could be kept back, so the errors are on flights that were fitted: fly more, every "
            "important manoeuvre at least twice"
        )


def of_the_voltage(training: Training) -> Iterator[str]:
    """A voltage that follows its current late."""
    lag = max(record.voltage_lag for record in training.records)
    if lag > 0.0:
        yield (
            f"the battery's voltage follows its current {lag:.2f} s late (a cell that polarises, or a filter "
            "before the log), and was fitted so; no vehicle file says it"
        )


def of_small_terms(found: Search, sizeable: Sequence[FittedTerm]) -> Iterator[str]:
    """Terms without a name that are no gap: all but the `sizeable`."""
    small = [one.term for one in found.unnamed if one not in sizeable]
    for formula in formulas(found.final, small, found.final.model.base):
        yield f"{formula}: real, but without a name and too small to matter to a flight"


def of_one_number_for_all(found: Search, names: Named, training: Training) -> Iterator[str]:
    """Named effects that one number does not tell for all flights."""
    flights = [record.name for record in training.records]
    for one in differing(found.final, names.effects):
        yield in_words(one, found.final.model.rule(one.variable).unit, flights)
