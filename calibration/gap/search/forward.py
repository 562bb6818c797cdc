"""The search for missing effects: forward, exchange, drop.

Each round offers every candidate to the present model, refits noise and nuisances for the most promising, and
takes the one that predicts flights best that its fit did not see. An effect that is beyond chance but too
small to matter stays in the model without a name: left out, another would be named for it.
"""

import dataclasses
import math
from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import NamedTuple

from calibration.gap.estimate.acceptance import DETECTABLE, LEAST_GAIN, Judgement, judge
from calibration.gap.estimate.model import WORKERS, Model, Variable
from calibration.gap.estimate.refine import Fitted, refine, settled
from calibration.gap.search.always import always_fitted
from calibration.gap.search.beside import explained_better
from calibration.gap.search.bounds import refused_axes, without_axes_at_bounds
from calibration.gap.search.candidates import SCALES, Candidate, candidates_for
from calibration.gap.search.credible import what_speaks_against
from calibration.gap.search.rivals import Rival
from calibration.gap.search.screen import Promise, screen
from calibration.gap.search.second_look import second_look
from calibration.gap.search.selection import SearchContext, SelectionStep, TimeToGo
from calibration.gap.search.shared_by_motors import scale_shared_by
from calibration.gap.unnamed.fitted_terms import FittedTerm, best_term, without_superfluous

_FAR_OFF = 0.1
"""Error of scale beyond which a drag or an inertia of absurd size would come first."""

_CLOSELY = 7
"""Candidates of a round that are looked at closely."""

_NO_PROMISE = 2.0
"""Log-likelihood: who promises less by a linear fit is not looked at closely, beyond the first few."""

_AT_LEAST = 3

_MORE = 1.2
"""Factor by which the promise of a candidate whose gain did not hold across flights must have grown before it
is looked at again, while nothing but terms without a name comes in."""

_HALF = 0.6
"""Share of what an unnamed term gains that a name must gain to be preferred to it."""

_PARSIMONY = 4.0
"""Log-likelihood that each further parameter must be worth."""

_MOST_ROUNDS, _MOST_LOOKS = 12, 3


@dataclass(frozen=True)
class Search:
    """Result of a search.

    Attributes:
        first: fit of the model as it was given, nuisances only.
        steps: effects in the order found, those without a name (too small to matter) among them.
        final: the last fit.
        refused: candidates that gained much but were not believed, with the reason.
        ambiguous: by named effect, the rivals that the flights do not rule out.
        blind: effects that the flights would not show at their ordinary size.
        unnamed: terms without a name that are in the final model.
    """

    first: Fitted
    steps: tuple[SelectionStep, ...]
    final: Fitted
    refused: dict[str, str]
    ambiguous: dict[str, tuple[Rival, ...]]
    blind: tuple[str, ...]
    unnamed: tuple[FittedTerm, ...]


def search(model: Model, context: SearchContext) -> Search:
    """Find what is missing in a model, from which the search begins."""
    first = refine(model, always_fitted(context.training), context.training)
    return _searched(first, _Grown(first, [], []), {}, context)


def search_on(found: Search, present: Fitted, context: SearchContext) -> Search:
    """Go on with a search from a fit without some of its effects, which are not believed any more.

    Args:
        found: the search.
        present: the fit without them.
        context: in which they are barred.
    """
    steps = [step for step in found.steps if step.effect in present.model.effects]
    unnamed = [one for one in found.unnamed if one.term in present.unnamed]
    return _searched(found.first, _Grown(present, steps, unnamed), dict(found.refused), context)


def _searched(first: Fitted, grown: "_Grown", refused: dict[str, str], context: SearchContext) -> Search:
    training = context.training
    for _ in range(_MOST_LOOKS):
        promises = _grow(grown, context, refused)
        present = without_superfluous(grown.present, grown.unnamed, training)
        before = set(present.model.effects)
        grown.present, grown.steps, ambiguous = second_look(present, grown.steps, context)
        if before.issuperset(grown.present.model.effects):
            break  # nothing was exchanged, which might have made room for something else
    present = without_axes_at_bounds(grown.present, training, refused)
    return Search(
        first=first,
        steps=tuple(grown.steps),
        final=present,
        refused=refused,
        ambiguous=ambiguous,
        blind=tuple(blind_to(promises, first.model)),
        unnamed=tuple(one for one in grown.unnamed if one.term in present.unnamed),
    )


@dataclass
class _Grown:
    """How far a search has come: its fit, and what came into it."""

    present: Fitted
    steps: list[SelectionStep]
    unnamed: list[FittedTerm]


class _Round(NamedTuple):
    """What one look at every candidate found.

    Attributes:
        promises: of all, the best first.
        step: the best that is believed.
        refused: why others are not.
        doubted: what those promised whose gain did not hold across flights.
    """

    promises: list[Promise]
    step: SelectionStep | None
    refused: dict[str, str]
    doubted: dict[str, float]


def _round(present: Fitted, context: SearchContext, doubted: Mapping[str, float]) -> _Round:
    promises = screen(present, candidates_for(present, context.training), context.training)
    return _forward(present, promises, context, doubted)


def _grow(grown: _Grown, context: SearchContext, refused: dict[str, str]) -> list[Promise]:
    """Take in what explains most, round by round, until nothing is believed; the last round's promises."""
    doubted: dict[str, float] = {}
    ahead: _Round | None = None
    rounds = TimeToGo()
    for _ in range(_MOST_ROUNDS):
        present = grown.present
        context.progress(f"every effect{rounds.to_go()}")  # one round more for each effect that is found
        found = ahead or _round(present, context, doubted)
        step, ahead = found.step, None
        refused |= found.refused
        doubted |= found.doubted
        alone = not (grown.steps or grown.unnamed)
        scale = _scale_first(present, found, context, _FAR_OFF if alone else None)
        if scale is not None:
            step, ahead = scale
        context.progress("what has no name")
        other = None if scale is not None else best_term(present, context.training, context.rng)
        if other is not None and (step is None or step.judgement.gain < _HALF * other.gain):
            grown.unnamed.append(other)
            grown.present = other.after
        elif step is not None:
            before = set(present.model.effects)
            others = [e for e in step.after.model.effects if e not in {*before, step.effect}]
            grown.steps += [dataclasses.replace(step, effect=effect) for effect in (step.effect, *others)]
            grown.present = step.after
            doubted.clear()
        else:
            break
    return found.promises


def _scale_first(
    present: Fitted, found: _Round, context: SearchContext, far_off: float | None
) -> tuple[SelectionStep, _Round] | None:
    """An error of scale that comes before the best effect of a round, and the round after it; None where the
    best effect stands.

    Args:
        present: the model before that round.
        found: the round.
        context: of the search.
        far_off: error of scale beyond which it does so whatever the best effect is, unless it is outdone;
            None: only where the best effect is four motors that share it, which never outdo it.
    """
    step = found.step
    scale = None if far_off is None else _error_of_scale(present, found.promises, context, far_off)
    if scale is not None:
        after = _round(scale.after, context, {})
        if not outdone(scale, step, after.step):
            return scale, after
    shared = None if step is None else scale_shared_by(step, present, context.training)
    promises = [promise for promise in found.promises if promise.candidate.effect == shared]
    scale = _error_of_scale(present, promises, context, 0.0)
    return None if scale is None else (scale, _round(scale.after, context, {}))


def _error_of_scale(
    present: Fitted, promises: Sequence[Promise], context: SearchContext, least: float
) -> SelectionStep | None:
    """The error of scale that explains most, of those that are `least` or more; None where none does."""
    training, fits = context.training, []
    for promise in promises:
        effect, variables = promise.candidate.effect, promise.candidate.variables
        if effect in SCALES:
            fitted = refine(present.model, (*present.variables, *variables), training, start=present)
            if abs(fitted.model.change(variables[0])) >= least:
                judgement = judge(present, fitted, variables, training, context.rng)
                fits.append(SelectionStep(effect, judgement, fitted))
    best = max(fits, key=lambda step: step.judgement.gain, default=None)
    return best if best is not None and best.judgement.gain >= LEAST_GAIN else None


def outdone(scale: SelectionStep, other: SelectionStep | None, after: SelectionStep | None) -> bool:
    """Whether another effect alone explains more than a scale and the effect that is best `after` it.

    Fits to the end are compared, by one hold-out: what each gained when it was offered had derivatives of a
    model near by, and was up to 25 in log-likelihood off.
    """
    if other is None:
        return False
    alone, both = other.after, (after or scale).after
    in_time = any(
        one.few_kinds(one.columns_of([v for v in one.variables if v not in two.variables]))
        for one, two in ((alone, both), (both, alone))
    )
    return float(alone.gains(both, in_time).sum()) > 0.0


def blind_to(promises: Sequence[Promise], model: Model) -> list[str]:
    """Effects of which not even the ordinary size would have been found in these flights."""
    return [
        promise.candidate.effect
        for promise in promises
        if promise.errors
        and all(
            DETECTABLE * error > max(abs(rule.typical - (rule.neutral or 0.0)), rule.practical_minimum)
            for rule, error in ((model.rule(v), error) for v, error in promise.errors.items())
        )
    ]


def _forward(
    present: Fitted, promises: Sequence[Promise], context: SearchContext, doubted: Mapping[str, float]
) -> _Round:
    """The best candidate that is believed.

    Args:
        present: the model that it would come into.
        promises: of all candidates, the best first.
        context: of the search.
        doubted: what those promised whose gain did not hold across flights, since the last effect came in.
    """
    training, rng, barred = context.training, context.rng, context.barred
    looked_at = [
        promise
        for rank, promise in enumerate(promises[:_CLOSELY])
        if (promise.gain >= _NO_PROMISE or rank < _AT_LEAST)
        and promise.gain > _MORE * doubted.get(promise.candidate.effect, -math.inf)
    ]
    context.progress(", ".join(promise.candidate.effect for promise in looked_at))

    def closely(candidate: Candidate) -> tuple[Fitted, Sequence[Variable]]:
        variables = (*present.variables, *candidate.variables)
        fitted = refine(candidate.starts[0], variables, training, start=present, near=present)
        return fitted, [v for v in candidate.variables if v.effect == candidate.effect]

    refused: dict[str, str] = {}
    doubtful: dict[str, float] = {}
    fits: list[tuple[float, Candidate, Fitted, Judgement]] = []
    with ThreadPoolExecutor(WORKERS) as pool:
        fitted_ones = list(pool.map(closely, [promise.candidate for promise in looked_at]))
    for promise, (fitted, own) in zip(looked_at, fitted_ones, strict=True):
        candidate, judgement = promise.candidate, judge(present, fitted, own, training, rng)
        fits.append((judgement.gain, candidate, fitted, judgement))
        if not judgement.significant:
            doubtful[candidate.effect] = promise.gain
        if rest := candidate.along_other_axes(judgement.at_bound):
            fitted, own = closely(rest)
            judgement = judge(present, fitted, own, training, rng)
            fits.append((judgement.gain, rest, fitted, judgement))
    fits.sort(key=lambda item: _PARSIMONY * len(item[1].variables) - item[0])
    better: list[tuple[Candidate, Fitted]] = []
    for gain, candidate, fitted, judgement in fits:
        if not (gain >= LEAST_GAIN or judgement.significant):
            continue
        others = [one for one in better if one[0].effect != candidate.effect]
        reason = _reason(fitted, judgement, [barred[e] for e in candidate.effects if e in barred])
        if reason is None and not explained_better((candidate, fitted), gain, others, present, training):
            rivals = {c.effect: gain - g for g, c, _, _ in fits if c.effect != candidate.effect}
            step = SelectionStep(candidate.effect, judgement, settled(fitted, training), rivals)
            refused |= refused_axes(candidate.effect, candidate.at_bound)
            return _Round(list(promises), step, refused, doubtful)
        if reason is not None:
            refused[candidate.effect] = reason
        if judgement.significant:
            better.append((candidate, fitted))
    return _Round(list(promises), None, refused, doubtful)


def _reason(fitted: Fitted, judgement: Judgement, barred: Sequence[str]) -> str | None:
    """Why a candidate is not believed; None where it is."""
    if barred:
        return barred[0]
    against = what_speaks_against(list(judgement.errors), fitted, judgement.errors)
    if against is None and not judgement.significant:
        return "its gain does not hold across flights"
    return against
