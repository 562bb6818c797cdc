"""What is offered to a fit: every candidate, those with many valleys from the bottom of a good one."""

from calibration.gap.candidates import Candidate, candidates
from calibration.gap.moments import Moments
from calibration.gap.refine import Fitted, Training
from onboard.vehicle import EFFECTS
from onboard.vehicle.effects import Domain


def offers(present: Fitted, training: Training) -> list[Candidate]:
    """Candidates for what `present` lacks.

    Forces without a derivative (a far ceiling, a slack string) get a single start, which fits single moments
    of the flights best.
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
        settled = [moments.settled(start, candidate.variables) for start in candidate.starts]
        best = min(settled, key=lambda one: one[0])[1]
        found[index] = candidate._replace(starts=(best,))
    return found
