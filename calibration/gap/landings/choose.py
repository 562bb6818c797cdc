"""From fits to names: which models are accepted, which rival them, and the intervals of their parameters."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from calibration.gap.landings.search import (
    CANDIDATES,
    HIGHEST,
    LOWEST,
    PERFECT,
    STRONGEST,
    LeaveOneOut,
    ScoreTable,
    Theta,
    bootstrap,
    leave_one_out,
)
from calibration.measurement import Interval, drawn_again, interval_of
from onboard.arrays import FloatArray
from onboard.vehicle import EFFECTS

Effects = tuple[str, ...]

LEAST_GAIN = 10.0
"""Held-out log likelihood that a model must gain over a simpler one."""

PRACTICAL: dict[str, float] = {"stiffness": math.log(1.2), "damping": math.log(1.3)}
"""Least change that is worth a name: 20 % of stiffness, 30 % of damping."""

LEAST_PRELOAD = 0.1
"""N, likewise."""

NUMERICAL: dict[str, float] = {"stiffness": 0.02, "damping": 0.05, "adhesion": 0.05, "preload": 0.1}
"""Standard deviations (of logarithms; N for the preload) of what a simulation at 1 ms finds in landings of
a finer one (docs/gap_landings_judged.md). What peaks of rod forces do to the adhesion is looked at by itself
(:func:`search.finer_adhesion`)."""

REPLICATES = 400


@dataclass(frozen=True)
class Choice:
    """What was accepted.

    Attributes:
        model: the accepted one; empty: none. effects: its effects, the one that explains most first.
        held_out: of every model that was fitted.
        rivals: effects of other models that do as well.
    """

    model: Effects
    effects: tuple[str, ...]
    held_out: Mapping[Effects, LeaveOneOut]
    rivals: tuple[str, ...]


def choose(table: ScoreTable, best: Mapping[Effects, Theta], rng: np.random.Generator) -> Choice:
    """Forward: the best accepted single effect, then a pair that is better still."""
    held = {model: leave_one_out(table, model, theta) for model, theta in best.items()}
    none = held[()].scores
    accepted = [
        model
        for model in best
        if model and practical(model, best[model]) and gains(held[model].scores - none, rng)
    ]
    singles = [model for model in accepted if len(model) == 1]
    chosen: Effects = max(singles, key=lambda m: held[m].scores.sum(), default=())
    pairs = [
        model
        for model in accepted
        if len(model) == 2 and gains(held[model].scores - held[chosen].scores, rng)
    ]
    if pairs:
        chosen = max(pairs, key=lambda m: held[m].scores.sum())
    effects = tuple(sorted(chosen, key=lambda effect: -float(held[(effect,)].scores.sum())))
    return Choice(chosen, effects, held, _rivals(chosen, accepted, held))


def gains(difference: FloatArray, rng: np.random.Generator) -> bool:
    """Whether a held-out gain (per landing) is large, and above zero when landings are drawn again."""
    drawn = difference[drawn_again(difference.size, REPLICATES, rng)].sum(axis=1)
    return bool(difference.sum() >= LEAST_GAIN and np.quantile(drawn, 0.025) > 0.0)


def practical(model: Sequence[str], theta: Theta) -> bool:
    """Whether every effect of the model differs from the vehicle file by more than is worth a name."""
    slips = theta.adhesion < PERFECT or theta.preload >= LEAST_PRELOAD
    moved = {name: abs(getattr(theta, name)) >= least for name, least in PRACTICAL.items()}
    return all(slips if effect == "foot_slip" else moved[CANDIDATES[effect][0]] for effect in model)


def at_bound(theta: Theta, effect: str) -> tuple[str, ...]:
    """Parameters of an effect that ended at the end of what is searched: a red flag."""
    return tuple(
        _WORDS[name]
        for name in CANDIDATES[effect]
        if name in theta.moved and getattr(theta, name) in (getattr(LOWEST, name), getattr(HIGHEST, name))
    )


def intervals(
    table: ScoreTable, held: LeaveOneOut, rng: np.random.Generator
) -> dict[str, dict[str, tuple[float, Interval]]]:
    """Value and 95 % interval of each parameter by effect.

    The wider of bootstrap and jackknife over landings, with the error of the simulation added.
    """
    drawn = bootstrap(table, held.model, rng, REPLICATES)
    out: dict[str, dict[str, tuple[float, Interval]]] = {}
    for effect in held.model:
        out[effect] = {}
        for name in CANDIDATES[effect]:
            if name not in held.theta.moved:
                continue
            axis = Theta._fields.index(name)
            value = held.theta[axis]
            low, high = interval_of(drawn[:, axis])
            others = np.array([theta[axis] for theta in held.chosen])
            jackknife = 1.96 * float(np.sqrt((others.size - 1) * np.var(others)))
            numerical = 1.96 * NUMERICAL[name]
            below = math.hypot(max(value - low, jackknife, 0.0), numerical)
            above = math.hypot(max(high - value, jackknife, 0.0), numerical)
            out[effect][_WORDS[name]] = _in_units(name, value, value - below, value + above)
    return out


_WORDS = {
    "stiffness": "scale",
    "damping": "scale",
    "adhesion": "adhesion_strength",
    "preload": "minimum_preload",
}


def _in_units(name: str, value: float, low: float, high: float) -> tuple[float, Interval]:
    if name == "preload":
        return value, (max(low, 0.0), high)
    if name == "adhesion" and high >= STRONGEST:
        high = math.log(EFFECTS["foot_slip"].parameters["adhesion_strength"].high)  # no strength is too much
    return math.exp(value), (math.exp(low), math.exp(high))


def _rivals(
    chosen: Effects, accepted: Sequence[Effects], held: Mapping[Effects, LeaveOneOut]
) -> tuple[str, ...]:
    """Effects of other accepted models, no larger, within LEAST_GAIN or two standard errors of the chosen."""
    rivals: dict[str, None] = {}
    for model in accepted:
        if set(model) >= set(chosen) or len(model) > len(chosen):
            continue
        behind = held[chosen].scores - held[model].scores
        error = 2.0 * float(np.sqrt(behind.size) * behind.std())
        if behind.sum() < max(LEAST_GAIN, error):
            rivals |= dict.fromkeys(effect for effect in model if effect not in chosen)
    return tuple(rivals)
