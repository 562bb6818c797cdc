"""Whether a candidate explains what another explains better: then it is no cause, but the nearest name."""

from collections.abc import Sequence

from calibration.gap.estimate.model import kinds_that_tell
from calibration.gap.estimate.refine import Fitted, Training, refine
from calibration.gap.estimate.shared_nuisances import swallowed
from calibration.gap.search.candidates import Candidate

_NEARLY = 0.7
"""Share of the best gain beyond chance from which the next candidate is believed where the best is not; one
that gains less must keep this share of its own beside that one."""


def explained_better(
    one: tuple[Candidate, Fitted],
    gain: float,
    better: Sequence[tuple[Candidate, Fitted]],
    present: Fitted,
    training: Training,
) -> bool:
    """Whether most of what a candidate gains is what another gains that explains more and is not believed.

    Then what is there has another cause, and the nearest name is not given to it. It is no nearest name where
    it explains a nuisance that all flights share and the other leaves.
    """
    candidate, alone = one
    return any(
        gain < _NEARLY * gain_where(candidate, other, present)
        and not swallowed(alone, other[1])
        and _gain_beside(one, other, present, training) < _NEARLY * gain
        for other in better
    )


def _gain_beside(
    one: tuple[Candidate, Fitted], other: tuple[Candidate, Fitted], present: Fitted, training: Training
) -> float:
    """What a candidate gains in a model that has the other one."""
    (candidate, alone), (its, beside) = one, other
    start = beside.model.with_values({v: alone.model.start_value(v) for v in candidate.variables})
    if alone.model.ceiling_z is not None and start.ceiling_z is None:
        start = start.at_ceiling(alone.model.ceiling_z)
    variables = dict.fromkeys((*present.variables, *its.variables, *candidate.variables))
    both = refine(start, tuple(variables), training, start=beside, near=beside)
    columns = both.columns_of(candidate.variables)
    return float(both.gains(beside, both.few_kinds(columns)).sum())


def gain_where(candidate: Candidate, other: tuple[Candidate, Fitted], present: Fitted) -> float:
    """What another candidate gains in the signals that tell of both: torques that nobody believes keep no
    force from its name."""
    its, fitted = other
    in_time = fitted.few_kinds(fitted.columns_of(its.variables))
    of_other = kinds_that_tell([its.effect])
    kinds = [kind for kind in kinds_that_tell([candidate.effect]) if kind in of_other]
    return float(fitted.gains(present, in_time, kinds).sum())
