"""The second look: is each name needed, and would another do as well?"""

import functools
import math
from collections.abc import Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
from scipy.stats import t as student

from calibration.gap.estimate.acceptance import LEAST_GAIN, sizeable
from calibration.gap.estimate.model import WORKERS, Model, Variable
from calibration.gap.estimate.refine import Fitted, Training, refine, settled
from calibration.gap.estimate.shared_nuisances import swallowed
from calibration.gap.search.candidates import SCALES, Candidate, candidates_for
from calibration.gap.search.credible import credible
from calibration.gap.search.linear_look import LinearLook, linear_look
from onboard.arrays import FloatArray
from onboard.mixer import PITCH, ROLL
from onboard.vehicle import EFFECTS

NOT_TOLD_APART = 10.0
"""Log-likelihood: a rival that is no more than this behind cannot be ruled out."""

KEPT = 0.5
"""Share of a gain that must be kept by what explains more with it: two effects, or the mean of a nuisance."""

_MOST_OF = 0.75
"""Share of an effect's gain that a rival must lack to be out of the question."""

_SAYS_MORE = 0.05
"""Share of an effect's gain that a rival with more parameters must gain beyond it: predictions are themselves
known to a few hundredths, and the more numbers, the more of that they fit."""

_SURE = 0.975
"""Of the distribution of leads over flights: a scatter that few of them show is known badly (Student)."""

_AS_WELL = 2.0
"""Log-likelihood that a rival may lack to explain as much."""

_BEYOND_DOUBT = 100.0
"""Log-likelihood of a lead that needs no scatter over flights to be believed: few flights may carry it. No
less, as models are right to some hundredths of what they explain: a lead of 67 of 752 was once wrong."""

HOPELESS = 100.0
"""Log-likelihood by which a linear fit must miss what is asked, for no other fit to be made."""

_DOUBTFUL = 3.0
"""Factor on what a name must gain, below which a first look does not decide that it does."""


_MOTORS = "motor_imbalance"
"""A difference between motors: takes no place of what they share (:data:`SCALES`)."""


@dataclass(frozen=True)
class Rival:
    """Another effect in the place of one that was named.

    Attributes:
        effect: its name.
        named: that in whose place it would be.
        lead: held-out log-likelihood by which the named effect is ahead.
        otherwise: likewise, with flights held out the other way (by shape, or in time).
        gain: what the named effect gains over neither.
        doubt: half of the 95 % interval of the lead, over flights.
        richer: whether it has more parameters than the named effect.
        sizeable: whether any of its parameters is large enough to be worth a name.
        swallowed: nuisances whose mean over the flights takes what the named effect explained.
        freed: nuisances whose mean it explains, and the named effect does not.
        spared: other effects of the model that are too small for a name beside it, not beside the named one.
        fewer: whether it has no more parameters than the named effect and those together.
        one_for_four: whether it is a scale, and the named effect four motors that all say what it does.
        fitted: the model with the rival.
    """

    effect: str
    named: str
    lead: float
    otherwise: float
    gain: float
    doubt: float
    richer: bool
    sizeable: bool
    swallowed: tuple[str, ...]
    freed: tuple[str, ...]
    spared: tuple[str, ...]
    fewer: bool
    one_for_four: bool
    fitted: Fitted

    @property
    def outdoes(self) -> bool:
        """Whether it explains more in the named effect's place, whichever way flights are held out."""
        if self.swallowed:
            return False
        if self.freed:
            return self.lead < (1.0 - KEPT) * self.gain
        least = max(LEAST_GAIN, _SAYS_MORE * self.gain) if self.richer else LEAST_GAIN
        return self.lead < -least and self.otherwise < 0.0

    @property
    def says_the_same_with_fewer_names(self) -> bool:
        """Whether the flights do not tell it from the named effect, and another name goes with that one.

        Two names that undo part of each other (a drag at the rotors, and the moment about the centre of mass
        that it does not have) are one cause, and so are four motors that are all as weak.
        """
        if self.one_for_four:
            return not self.swallowed and self.lead <= NOT_TOLD_APART
        simpler = self.effect in EFFECTS[self.named].alike or self.fewer
        return bool(simpler and self.spared) and not self.swallowed and abs(self.lead) <= NOT_TOLD_APART

    @property
    def negligible(self) -> bool:
        """Whether something too small for a name explains as much: the name claims more than is known."""
        return not (self.sizeable or self.swallowed) and max(self.lead, self.otherwise) <= _AS_WELL

    @property
    def told_apart(self) -> bool:
        """Whether the flights rule the rival out, or it says no more with more parameters."""
        if self.swallowed:
            return True
        if self.freed:
            return not self.outdoes
        if self.richer and self.lead >= -max(NOT_TOLD_APART, _SAYS_MORE * self.gain):
            return True
        return self.lead > min(max(NOT_TOLD_APART, self.doubt), _BEYOND_DOUBT)


def without(final: Fitted, training: Training, *effects: str) -> Fitted:
    """The model fitted without some of its effects."""
    return settled(nearly_without(final, training, *effects), training)


def nearly_without(final: Fitted, training: Training, *effects: str) -> Fitted:
    """:func:`without` with the derivatives of the model that has these effects: enough for a first look."""
    rest = [v for v in final.variables if v.effect not in effects]
    model = functools.reduce(Model.without, effects, final.model)
    return refine(model, rest, training, start=final, near=final)


def needed(final: Fitted, effect: str, training: Training) -> bool:
    """Whether the flights get less likely when an effect is taken out and the others are fitted anew, or the
    nuisances take what it explained."""
    in_time = final.few_kinds(final.columns_of(_variables(final, effect)))

    def gain_over(reduced: Fitted) -> float:
        return float(final.gains(reduced, in_time).sum())

    reduced = nearly_without(final, training, effect)
    if effect in SCALES and alike_in_all_motors(reduced.model) and not alike_in_all_motors(final.model):
        return True  # four motors have taken its place
    if _DOUBTFUL * LEAST_GAIN > gain_over(reduced) >= LEAST_GAIN:
        reduced = settled(reduced, training)  # with its own derivatives it may do without
    return gain_over(reduced) >= LEAST_GAIN or bool(swallowed(final, reduced))


def rivals(
    final: Fitted, effect: str, close: Sequence[str], training: Training, barred: Iterable[str] = ()
) -> list[Rival]:
    """Effects that could stand in the place of a named one and be believed, the closest first, but for those
    far behind.

    Args:
        final: the fit with all effects.
        effect: the one to be replaced.
        close: effects that came close when it was found; those it is commonly confused with are added.
        training: the flights.
        barred: effects that take no name's place.
    """
    names = {*close, *EFFECTS[effect].confused_with} - {effect, *final.model.effects, *barred}
    look = linear_look(final, training, names)
    far = {name for name in look.offered if _is_far_behind(look, effect, name)}
    reduced = nearly_without(final, training, effect)
    offered = candidates_for(reduced, training, names - far)
    with ThreadPoolExecutor(WORKERS) as pool:
        found = list(pool.map(lambda c: _rival(final, effect, reduced, c, training), offered))
    found = [one for one in found if not (effect in SCALES and alike_in_all_motors(one.fitted.model))]
    # What would be refused later takes no name's place now.
    found = [one for one in found if credible(one.fitted, one.effect, training)]
    return sorted(found, key=lambda rival: rival.lead)


def alike_in_all_motors(model: Model) -> bool:
    """Whether four motors are further from what the vehicle file says than from each other: that is a scale
    of thrust, in whose place they stand, and no difference between motors."""
    motors = np.array([value for v, value in model.values.items() if v.effect == _MOTORS])
    if not motors.size:
        return False
    differences = motors - motors.mean()
    body = model.base.body
    for axis, side, arm in (("x", -PITCH, body.arm_x), ("y", ROLL, body.arm_y)):
        centre = model.values.get(Variable("com_offset", axis), 0.0)
        differences -= motors.mean() * centre / arm.value * side  # which holds the thrust's centre over it
    return bool(abs(motors.mean() - 1.0) > np.abs(differences).max())


def _is_far_behind(look: LinearLook, effect: str, rival: str) -> bool:
    """Whether a rival explains so little of what a named effect does that no closer fit need be made."""
    lead, gain = look.lacks([effect], rival), look.lacks([effect])
    return bool(np.all(lead > np.maximum(HOPELESS, _MOST_OF * gain)))


def _rival(final: Fitted, effect: str, reduced: Fitted, candidate: Candidate, training: Training) -> Rival:
    variables = (*reduced.variables, *candidate.variables)
    fits = [refine(model, variables, training, start=final, near=reduced) for model in candidate.starts]
    other = max(fits, key=lambda fit: float(fit.gains(reduced, True).sum()))
    rival = _compared(final, effect, reduced, other, candidate, training)
    if rival.told_apart and rival.lead > 0.0:
        return rival
    # With derivatives of a model near by, a fit may look better than the one that has its own.
    return _compared(final, effect, reduced, settled(other, training), candidate, training)


def _compared(
    final: Fitted, effect: str, reduced: Fitted, other: Fitted, candidate: Candidate, training: Training
) -> Rival:
    """Both by the same hold-out: in time where few flights tell of either."""
    own, of_rival = _variables(final, effect), candidate.variables
    in_time = final.few_kinds(final.columns_of(own)) or other.few_kinds(other.columns_of(of_rival))
    spared = tuple(
        name
        for name in other.model.effects
        if name != candidate.effect and _is_large(final, name) and not _is_large(other, name)
    )
    spent = len(own) + sum(len(_variables(final, name)) for name in spared)
    by_flight = np.bincount(training.flight_of_part, weights=final.gains(other, in_time))
    leads = by_flight.astype(np.float64)
    return Rival(
        effect=candidate.effect,
        named=effect,
        lead=float(leads.sum()),
        otherwise=float(final.gains(other, not in_time).sum()),
        gain=float(final.gains(reduced, in_time).sum()),
        doubt=doubt_of(leads),
        richer=len(of_rival) > len(own),
        sizeable=any(sizeable(other.model, v) for v in of_rival),
        swallowed=swallowed(final, other),
        freed=swallowed(other, final),
        spared=spared,
        fewer=len(of_rival) <= spent,
        one_for_four=candidate.effect in SCALES and effect == _MOTORS and alike_in_all_motors(final.model),
        fitted=other,
    )


def doubt_of(leads: FloatArray) -> float:
    """Half of the 95 % interval of the sum of the leads of some flights."""
    if leads.size < 2:
        return math.inf
    error = math.sqrt(leads.size) * float(leads.std(ddof=1))
    return float(student.ppf(_SURE, leads.size - 1)) * error


def _is_large(fitted: Fitted, effect: str) -> bool:
    """Whether an effect of a model is large enough for a name."""
    return any(sizeable(fitted.model, v) for v in fitted.model.values if v.effect == effect)


def _variables(fitted: Fitted, effect: str) -> list[Variable]:
    return [v for v in fitted.variables if v.effect == effect]
