"""Which legs, pads and hull make landings end as they did: a posterior over a grid of vehicles.

Every vehicle of the grid predicts every flight once (:mod:`..vehicles`). The probability of what happened,
all flights together, is a vehicle's likelihood; with every vehicle of the grid as likely beforehand its share
is its posterior. A prediction is the mean over the posterior (Bayesian model averaging: Hoeting et al.,
Statist. Sci. 14, 382, 1999), so that what a few flights leave open widens it. What is named has its value
from all models that have it open, each as much as its evidence says, and not from the best alone: that one
may shut what has no name and yet bends the value (hinges as filed: a limit of pads of twice what is true, and
sure of it). Flights are predicted from the others: one left out, and each half from the other. Nothing maps
probabilities to probabilities.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Any, NamedTuple

import numpy as np

from calibration.gap.landings.outcomes.held_out import (
    HalfScore,
    half_score,
    held_out,
    left_one_out,
    posterior,
)
from calibration.gap.landings.outcomes.scores import Score, brier, score, surprise
from calibration.gap.landings.outcomes.vehicles import EFFECT_OF, NATURAL_ENDS, UNITS, WITHOUT, Point
from calibration.measurement import Interval, drawn_again, interval_of
from onboard.arrays import FloatArray, IntArray

LEAST_GAIN = 0.05
"""Of the Brier score: what predicts flights better by less is not named, however sure. Where nearly all feet
hold anyway, a vehicle that is a little surer of it gains 0.02 for certain."""

LEAST_NAMING = 12
"""Classified flights that a search needs. Where the file is right it names something in 12 % of sets of 4
flights, in 4 % of 8, in 2 % of 12 (docs/gap_landings_judged.md, "How many flights a name needs")."""

DRAWN = 20_000
"""Sets of flights behind the interval of a gain: a name must not hang on which sets were drawn."""

END_SHARE = 0.05
"""Of a posterior at the outermost value that was tried: with more its moments are those of the edge."""

GROUPS: dict[str, tuple[str, ...]] = {
    "hinges": ("stiffness", "damping"),
    "pads": ("speed", "spread"),
    "propellers": ("reach",),
    "preload": ("preload", "preload_spread"),
    "impulse": ("impulse", "impulse_spread"),
    "angle": ("angle", "angle_spread"),
    "axes": ("side_stiffness", "side_damping"),
    "hull": ("width", "top", "bottom"),
}
"""Coordinates that are open together."""

LAWS = ("pads", "preload", "impulse", "angle")
"""Groups that say what a foot needs to stick, each in place of what the vehicle file says of that."""

_CORE = ("hinges", "pads", "propellers")

_SHAPES = ("axes", "hull")
"""Groups that are tried one at a time beside hinges and pads."""

MODELS: tuple[tuple[str, ...], ...] = (
    *(groups for size in range(len(_CORE) + 1) for groups in combinations(_CORE, size)),
    *(groups for law in LAWS[1:] for groups in ((law,), ("hinges", law))),
    *((*groups, shape) for shape in _SHAPES for groups in ((), ("hinges",), ("pads",), ("hinges", "pads"))),
)
"""Which groups are open; the rest is as filed."""


class GridEstimate(NamedTuple):
    """Of a coordinate over the vehicles of the grid.

    Attributes:
        mean, sigma: of the posterior. ci95: of it; no further than the grid reaches.
        ends: outermost values that were tried, other than natural ends, which hold more than END_SHARE of
            the posterior: what is true may lie beyond, and the rest says how far at most by chance.
    """

    mean: float
    sigma: float
    ci95: Interval
    ends: tuple[float, ...]

    @property
    def at_bound(self) -> bool:
        """Whether it runs into the end of what was tried."""
        return bool(self.ends)

    def json_shape(self, unit: str) -> dict[str, Any]:
        """As a JSON object."""
        return {
            "value": self.mean,
            "sigma": self.sigma,
            "unit": unit,
            "ci95": self.ci95,
            "at_bound": self.at_bound,
        }


def model_name(groups: Sequence[str]) -> str:
    """A model in words, from the groups that it leaves open."""
    return ", ".join(groups) or "as filed"


@dataclass(frozen=True)
class Change:
    """Mean change of the Brier score over flights from one model to another, with its 95 % interval (flights
    drawn again)."""

    brier: float
    ci95: Interval


@dataclass(frozen=True)
class Gain(Change):
    """A change, also without the flight that speaks most for it: no name rests on one flight."""

    without_best_flight: float


@dataclass(frozen=True)
class ModelFit:
    """One model.

    Attributes:
        groups: what it leaves open.
        left_one_out: score on flights that it did not see.
        halves: likewise, each half predicted from the other, SPLITS times.
        left_out: what it says of each flight from the others (n, 3). brier: of that, by flight (n,).
        values: posterior mean, standard deviation and 95 % interval by coordinate.
        shares: posterior of the vehicles of the whole grid (points,).
        log_evidence: ln of the mean probability, over the vehicles that it leaves open, of what happened.
    """

    groups: tuple[str, ...]
    left_one_out: Score
    halves: HalfScore
    left_out: FloatArray
    brier: FloatArray
    values: dict[str, GridEstimate]
    shares: FloatArray
    log_evidence: float

    @property
    def name(self) -> str:
        """In words."""
        return model_name(self.groups)

    def json_shape(self) -> dict[str, Any]:
        """As a JSON object."""
        return {
            "model": self.name,
            "left_one_out": self.left_one_out,
            "halves": self.halves,
            "values": {name: estimate.json_shape(UNITS[name]) for name, estimate in self.values.items()},
        }


@dataclass(frozen=True)
class OutcomeSearch:
    """What the outcomes say of legs, pads, propellers and hull.

    Attributes:
        fits: of all models.
        best: the model with the lowest log score, left one out, among those with the law that is named.
        named: groups without which flights are predicted worse, beyond chance and by enough to matter; of the
            laws of pads the best one.
        gains: by group, from the best model without it (of a law: without any) to the best with it, left one
            out.
        values: of the coordinates of what is named: over all models that have that open, by their evidence.
        laws: from the law that is named, else the best one, to each law; with hinges open at most.
        filed: what the vehicle file says.
    """

    fits: tuple[ModelFit, ...]
    best: ModelFit
    named: tuple[str, ...]
    gains: dict[str, Gain]
    values: dict[str, GridEstimate]
    laws: dict[str, Change]
    filed: Point

    @property
    def left_open(self) -> tuple[str, ...]:
        """Groups that the flights neither name nor refute: a law is refuted by another that does better."""
        refuted = {law for law, change in self.laws.items() if change.ci95[0] > 0.0}
        return tuple(group for group in GROUPS if group not in self.named and group not in refuted)

    def json_shape(self) -> dict[str, Any]:
        """``effects`` and ``search`` of the document."""
        effects: dict[str, dict[str, Any]] = {}
        for group in self.named:
            gain = self.gains[group]
            for coordinate in GROUPS[group]:
                effect, parameter = EFFECT_OF[coordinate]
                entry = effects.setdefault(
                    effect,
                    {
                        "name": effect,
                        "parameters": {},
                        "error_after": self.best.left_one_out.brier,
                        "error_before": self.best.left_one_out.brier - gain.brier,
                        "improvement_ci95": [-gain.ci95[1], -gain.ci95[0]],
                        "ambiguous_with": [EFFECT_OF[GROUPS[other][0]][0] for other in self.left_open],
                    },
                )
                entry["parameters"][parameter] = self.values[coordinate].json_shape(UNITS[coordinate])
        return {
            "effects": list(effects.values()),
            "search": {
                "best": self.best.name,
                "models": self.fits,
                "gains": self.gains,
                "laws": self.laws,
            },
        }


def search_outcomes(
    points: Sequence[Point], table: FloatArray, real: IntArray, draws: int, rng: np.random.Generator,
    filed: Point = WITHOUT,
) -> OutcomeSearch:  # fmt: skip
    """All models on one table.

    Args:
        points: vehicles (m). table: (m, n, 3). real: classes (n,).
        draws: landings behind each probability.
        rng: draws flights.
        filed: one of the vehicles: what a group has that is not open.
    """
    logs = logs_of(table, real, draws)
    fits = tuple(_fit(groups, filed, np.array(points), table, logs, real, draws, rng) for groups in MODELS)
    drawn = drawn_again(real.size, DRAWN, rng)
    log_scores = np.array([fit.left_one_out.log_score for fit in fits])
    selected = select(log_scores, np.array([fit.brier for fit in fits]), drawn)
    return OutcomeSearch(
        fits=fits,
        best=fits[selected.best],
        named=selected.named,
        gains=selected.gains,
        values=_averaged(selected.named, fits, np.array(points)),
        laws=selected.laws,
        filed=filed,
    )


def logs_of(table: FloatArray, real: IntArray, draws: int) -> FloatArray:
    """ln p of what happened (points, n), from predictions (points, n, 3) and classes (n,)."""
    return np.array([-surprise(one, real, draws) for one in table])


class Selection(NamedTuple):
    """What is said where the models score so.

    Attributes:
        best: index of the model. named, gains, laws: as in :class:`OutcomeSearch`.
    """

    best: int
    named: tuple[str, ...]
    gains: dict[str, Gain]
    laws: dict[str, Change]


def select(log_scores: FloatArray, briers: FloatArray, drawn: IntArray) -> Selection:
    """Choose among MODELS (m), and say what is missing.

    Args:
        log_scores: (m,), left one out. briers: by flight (m, n), likewise.
        drawn: sets of flights (sets, n), for intervals.
    """

    def best(models: Iterable[int]) -> int:
        return min(models, key=lambda model: float(log_scores[model]))

    models = list(enumerate(MODELS))
    gains = {}
    for group in GROUPS:
        shut = set(LAWS) if group in LAWS else {group}
        with_it = best(m for m, groups in models if group in groups)
        without = best(m for m, groups in models if not shut & set(groups))
        change = briers[with_it] - briers[without]
        gains[group] = Gain(*_mean_of(change, drawn), float(np.sort(change)[1:].mean()))
    told = [
        group for group, one in gains.items() if one.ci95[1] < 0.0 and one.without_best_flight <= -LEAST_GAIN
    ]
    like = {"hinges", *LAWS}  # what all laws were tried with
    laws = {law: best(m for m, groups in models if law in groups and set(groups) <= like) for law in LAWS}
    able = [law for law in LAWS if law in told] or LAWS
    chosen = min(able, key=lambda law: log_scores[laws[law]])
    named = tuple(group for group in told if group not in LAWS or group == chosen)
    return Selection(
        best=best(m for m, groups in models if chosen not in named or chosen in groups),
        named=named,
        gains=gains,
        laws={law: Change(*_mean_of(briers[laws[law]] - briers[laws[chosen]], drawn)) for law in LAWS},
    )


def _averaged(named: Sequence[str], fits: Sequence[ModelFit], points: FloatArray) -> dict[str, GridEstimate]:
    """Estimates of what is named, each group's over the models that have it open; one with another law of the
    pads than the named one is no model of it."""
    other_laws = set(LAWS) - set(named) if set(LAWS) & set(named) else set()
    values = {}
    for group in named:
        able = [fit for fit in fits if group in fit.groups and not other_laws & set(fit.groups)]
        evidence = np.array([fit.log_evidence for fit in able])
        weight = np.exp(evidence - evidence.max())
        shares = weight @ np.array([fit.shares for fit in able]) / weight.sum()
        for name in GROUPS[group]:
            values[name] = estimate_of(name, points[:, Point._fields.index(name)], shares)
    return values


def _mean_of(change: FloatArray, drawn: IntArray) -> tuple[float, Interval]:
    """Mean over flights (n,), and its 95 % interval over sets of them (sets, n)."""
    return float(change.mean()), interval_of(change[drawn].mean(axis=1))


def _fit(
    groups: tuple[str, ...], filed: Point, points: FloatArray, table: FloatArray, logs: FloatArray,
    real: IntArray, draws: int, rng: np.random.Generator,
) -> ModelFit:  # fmt: skip
    rows = open_vehicles(groups, filed, points)
    own, own_logs = table[rows], logs[rows]
    left = left_one_out(own, own_logs)
    share = posterior(own_logs, np.ones(real.size, dtype=np.bool_))
    shares = np.zeros(len(points))
    shares[rows] = share
    free = [name for group in groups for name in GROUPS[group]]
    return ModelFit(
        groups=groups,
        left_one_out=score(left, real, draws, rng),
        halves=half_score(real, lambda half: held_out(own, own_logs, real, half), rng),
        left_out=left,
        brier=brier(left, real),
        values={name: estimate_of(name, points[rows, Point._fields.index(name)], share) for name in free},
        shares=shares,
        log_evidence=float(np.logaddexp.reduce(own_logs.sum(axis=1)) - np.log(rows.size)),
    )


def open_vehicles(groups: tuple[str, ...], filed: Point, points: FloatArray) -> IntArray:
    """Indices of the vehicles (points, coordinates) that a model leaves open."""
    free = [Point._fields.index(name) for group in groups for name in GROUPS[group]]
    shut = np.setdiff1d(np.arange(len(filed)), free)
    rest = filed
    if set(LAWS) & set(groups):  # one law in place of what is filed
        rest = filed._replace(**{name: getattr(WITHOUT, name) for law in LAWS for name in GROUPS[law]})
    return np.flatnonzero(np.all(points[:, shut] == np.array(rest)[shut], axis=1))


def estimate_of(name: str, value: FloatArray, share: FloatArray) -> GridEstimate:
    """Of a coordinate over vehicles: a point of the grid stands for all half-way to the next.

    Args:
        name: of the coordinate. value, share: of the vehicles (n,).
    """
    mean = float(share @ value)
    sigma = float(np.sqrt(share @ (value - mean) ** 2))
    levels, inverse = np.unique(value, return_inverse=True)
    held = np.bincount(inverse, weights=share)
    reached = np.cumsum(held)
    outer = {0, levels.size - 1} if name in NATURAL_ENDS else ()
    full = [float(levels[at]) for at in sorted(outer) if held[at] > END_SHARE]
    ends = tuple(end for end in full if end not in NATURAL_ENDS[name])
    edges = np.concatenate([levels[:1], 0.5 * (levels[1:] + levels[:-1]), levels[-1:]])
    first, last = (min(int(np.searchsorted(reached, q)), levels.size - 1) for q in (0.025, 0.975))
    interval = float(edges[first]), float(edges[last + 1])
    return GridEstimate(mean, sigma, interval, ends)
