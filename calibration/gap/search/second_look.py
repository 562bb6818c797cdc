"""The second look at a search's names: drop what is superfluous, exchange what another explains better, or
something too small for a name as well.

A greedy search takes the effect that gains most alone. Where two causes overlap, that may be a third one, or
two that together do what one does (a scale of thrust is a mass and three inertias).
"""

import dataclasses
import functools
import itertools
from collections.abc import Mapping, Sequence

import numpy as np

from calibration.gap.estimate.acceptance import judge
from calibration.gap.estimate.refine import Fitted, Training, refine, settled
from calibration.gap.estimate.shared_nuisances import swallowed
from calibration.gap.search.always import LOG_TIMING, late_by_more_than_the_log
from calibration.gap.search.candidates import Candidate, candidates
from calibration.gap.search.credible import credible
from calibration.gap.search.linear_look import LinearLook, linear_look
from calibration.gap.search.rivals import (
    HOPELESS,
    KEPT,
    Rival,
    alike_in_all_motors,
    nearly_without,
    needed,
    rivals,
    without,
)
from calibration.gap.search.screen import screen
from calibration.gap.search.selection import SearchContext, SelectionStep, TimeToGo
from onboard.vehicle import EFFECTS

Ambiguous = dict[str, tuple[Rival, ...]]
"""By named effect, the rivals that the flights do not rule out."""

_CLOSE = 0.3
"""Share of its gain that a rival may lack to be looked at again."""


def second_look(
    present: Fitted, steps: Sequence[SelectionStep], context: SearchContext
) -> tuple[Fitted, list[SelectionStep], Ambiguous]:
    """Drop what others have made superfluous; put in the place of names what outdoes them.

    Args:
        present: fit with all names.
        steps: how they came in.
        context: of the search.

    Returns:
        The fit, its steps, and by named effect the rivals that the flights do not rule out.
    """
    training = context.training
    present = _drop_superfluous(present, steps, context)
    left = [step for step in steps if step.effect in present.model.effects]
    present, left = _one_for_two(present, left, context)
    ambiguous: Ambiguous = {}
    names = TimeToGo()
    for index, step in enumerate(left):
        if not step.judgement.sizeable:
            continue
        context.progress(f"{step.effect} or another{names.to_go(len(left) - index)}")
        found = _rivals(present, step, context)
        small = next((rival for rival in found if rival.negligible), None)
        if small is not None:
            present = settled(small.fitted, training)
            left[index] = dataclasses.replace(step, effect=small.effect, after=present)
            continue
        best = next((rival for rival in found if rival.outdoes), None)
        best = best or next((rival for rival in found if rival.says_the_same_with_fewer_names), None)
        # A single name gained most of all when it was found.
        if best is not None and (best.freed or best.one_for_four or len(left) > 1):
            present = settled(best.fitted, training)
            left[index] = step = dataclasses.replace(step, effect=best.effect, after=present)
            found = _rivals(present, step, context)
        if doubtful := tuple(rival for rival in found if not rival.told_apart):
            ambiguous[step.effect] = doubtful
    if late_by_more_than_the_log(present.model, training):  # which no round has asked about
        late = rivals(present, LOG_TIMING.effect, (), training, context.barred)
        if doubtful := tuple(rival for rival in late if not rival.told_apart):
            ambiguous[LOG_TIMING.effect] = doubtful
    return present, left, ambiguous


def _drop_superfluous(present: Fitted, steps: Sequence[SelectionStep], context: SearchContext) -> Fitted:
    """The model without effects that others have made superfluous, the weakest first."""
    training = context.training
    for step in sorted(steps, key=lambda s: s.judgement.gain):
        context.progress(f"without {step.effect}")
        if len(steps) > 1 and not needed(present, step.effect, training):
            # What has no name takes no name's place: a drag stays one beside a force of any shape.
            plain = _without_what_has_no_name(present, training)
            if plain is present or not needed(plain, step.effect, training):
                present = without(present, training, step.effect)
    return present


def _without_what_has_no_name(present: Fitted, training: Training) -> Fitted:
    """The fit with its names alone; itself where it has nothing else."""
    if not present.unnamed:
        return present
    return refine(present.model, present.variables, training, start=present, unnamed=())


def _rivals(present: Fitted, step: SelectionStep, context: SearchContext) -> list[Rival]:
    """Effects in the place of a named one, the closest first."""
    close = [name for name, lack in step.rivals.items() if lack < _CLOSE * step.judgement.gain]
    return rivals(present, step.effect, close, context.training, context.barred)


def _one_for_two(
    present: Fitted, steps: list[SelectionStep], context: SearchContext
) -> tuple[Fitted, list[SelectionStep]]:
    """One cause in the place of two names that it explains, where there is one with fewer parameters."""
    training = context.training

    @functools.cache
    def lacking(name: str) -> Fitted:
        return nearly_without(present, training, name)

    pairs = {
        (one.effect, other.effect): set(EFFECTS[one.effect].confused_with)
        & set(EFFECTS[other.effect].confused_with) - {*present.model.effects, *context.barred}
        for one, other in itertools.combinations(steps, 2)
    }
    look = linear_look(present, training, set().union(*pairs.values()))
    for one, other in itertools.combinations(steps, 2):
        common = pairs[one.effect, other.effect]
        common = {name for name in common if _may_explain(look, (one.effect, other.effect), name)}
        if not common:
            continue
        context.progress(f"one effect for {one.effect} and {other.effect}")
        reduced = nearly_without(present, training, one.effect, other.effect)
        cause = _common_cause(present, reduced, common, training)
        alone = {name: lacking(name) for name in (one.effect, other.effect)} if cause else {}
        if cause is None or alike_in_all_motors(cause[1].model) or not _explains(cause[1], present, alone):
            continue
        candidate, fitted = cause[0], settled(cause[1], training)
        if not (_explains(fitted, present, alone) and credible(fitted, candidate.effect, training)):
            continue  # with derivatives of a model near by it looked better than it is
        step = SelectionStep(
            candidate.effect, judge(reduced, fitted, candidate.variables, training, context.rng), fitted
        )
        kept = [step if s is one else s for s in steps if s is not other]
        return _one_for_two(fitted, kept, context)
    return present, steps


def _may_explain(look: LinearLook, names: tuple[str, str], cause: str) -> bool:
    """Whether a linear fit does not rule out that one cause keeps what each of two names gains."""
    if cause not in look.offered:
        return False
    gained = np.minimum(*(look.lacks([name]) for name in names))
    return bool(np.any(look.lacks(names, cause) <= np.maximum(gained, 0.0) + HOPELESS))


def _common_cause(
    present: Fitted, reduced: Fitted, names: set[str], training: Training
) -> tuple[Candidate, Fitted] | None:
    """The effect of these that promises most in a model without the two names, and a first fit with it."""
    fewer = len(present.variables) - len(reduced.variables)
    offered = [
        candidate
        for candidate in candidates(reduced.model, training.records, names)
        if candidate.starts[0] is reduced.model and len(candidate.variables) < fewer
    ]
    if not offered:
        return None
    best = screen(reduced, offered, training)[0].candidate
    variables = (*reduced.variables, *best.variables)
    return best, refine(reduced.model, variables, training, start=present, near=reduced)


def _explains(cause: Fitted, present: Fitted, lacking: Mapping[str, Fitted]) -> bool:
    """Whether a fit with one cause keeps most of what each of two names gains, and hides nothing.

    Args:
        cause: the fit.
        present: that with both names.
        lacking: by name, the fit without it alone.
    """
    if swallowed(present, cause):
        return False
    in_time = any(
        present.few_kinds(present.columns_of([v for v in present.variables if v.effect == name]))
        for name in lacking
    )
    lost = float(present.gains(cause, in_time).sum())
    return lost <= (1.0 - KEPT) * min(float(present.gains(one, in_time).sum()) for one in lacking.values())
