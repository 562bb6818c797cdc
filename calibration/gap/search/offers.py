"""What is offered to a fit: every candidate, those with many valleys from the bottom of a good one."""

from calibration.gap.estimate.acceptance import stuck
from calibration.gap.estimate.model import Model
from calibration.gap.estimate.refine import Fitted, Training
from calibration.gap.search.candidates import Candidate, candidates
from calibration.gap.search.moments import Moments
from onboard.vehicle import EFFECTS
from onboard.vehicle.effects import Domain


def offers(present: Fitted, training: Training) -> list[Candidate]:
    """Candidates for what `present` lacks.

    Forces without a derivative (a far ceiling, a slack string) start from what fits single moments of the
    flights best, a ceiling of unknown height from what does so at each of several heights and at any.
    """
    found = candidates(present.model, training.records)
    moments: Moments | None = None
    for index, candidate in enumerate(found):
        if candidate.starts[0] is present.model or EFFECTS[candidate.effect].domain is Domain.ACTUATION:
            continue
        if moments is None:
            signals = training.regression.signals
            misfit = training.regression.misfit(present.predicted)
            moments = Moments(present.model, training.records, signals, misfit)
        found[index] = candidate._replace(starts=(_deepest(candidate, present.model, moments),))
    return found


def _deepest(candidate: Candidate, base: Model, moments: Moments) -> Model:
    """The best fit to the moments; one at a bound only if all are."""
    settled = [moments.settled(start, candidate.variables) for start in candidate.starts]
    if candidate.effect == "ceiling_effect" and base.ceiling_z is None:
        settled += [moments.settled(start, candidate.variables, True) for start in candidate.starts[:2]]
    inside = [one for one in settled if not any(stuck(v, one[1].start_value(v)) for v in candidate.variables)]
    return min(inside or settled, key=lambda one: one[0])[1]
