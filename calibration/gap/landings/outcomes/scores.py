"""How good probabilities of four legs, two and none are, beside always guessing the base rate.

Brier score: sum over the classes of (p - 1 for the real one, p - 0 for the others)^2, mean over flights; 0 is
perfect, 2 the worst. Log score: mean of -ln p of what happened. The base rate is what the other flights did
(left one out): the base rate of all knows the flight that it is judged on. Intervals draw flights again,
model and base rate on the same flights (paired bootstrap).

Probabilities say themselves how large their score is where they are right. A real Brier score that is larger
than what outcomes drawn from them would get is the calibration test of Spiegelhalter (Stat. Med. 5, 421,
1986), with the drawn distribution in place of the normal one. Totals cannot see what it sees: probabilities
that belong to other flights, or are surer than they should be.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from calibration.gap.landings.outcomes.labels import CLASS_NAMES
from calibration.measurement import Interval, drawn_again, interval_of, wilson_interval
from onboard.arrays import BoolArray, FloatArray, IntArray

REPLICATES = 2000
"""Sets of flights that are drawn."""

DRAWN_OUTCOMES = 4000
"""Sets of outcomes that are drawn from the probabilities: a p-value of 0.025 is known to 0.0025."""

BINS = 5
"""Of the reliability diagram, of equal count."""

_ROUNDING = 1e-12
"""Scores of the same outcomes are the same."""


@dataclass(frozen=True)
class Bin:
    """Flights of similar probability of four legs.

    Attributes:
        flights: how many. p_four: their mean probability. real: share that landed on four.
        ci95: interval (Wilson) of that share.
    """

    flights: int
    p_four: float
    real: float
    ci95: Interval


@dataclass(frozen=True)
class Count:
    """How many flights ended in a class.

    Attributes:
        real: flights. expected: by the model.
        interval80: of the number that the model predicts (Poisson binomial).
        p_value: probability of a number as far off as the real one or farther: twice the smaller tail.
    """

    real: int
    expected: float
    interval80: tuple[int, int]
    p_value: float

    @property
    def inside(self) -> bool:
        """Whether the real number is one that the model expects."""
        return self.interval80[0] <= self.real <= self.interval80[1]


@dataclass(frozen=True)
class ExpectedBrier:
    """Brier score of flights whose outcomes follow the probabilities.

    Attributes:
        mean: expected. ci95: interval of it, of as many flights.
        p_value: probability of a score as bad as the real one or worse.
    """

    mean: float
    ci95: Interval
    p_value: float


@dataclass(frozen=True)
class Score:
    """The scores of a set of flights.

    Attributes:
        flights: scored ones.
        brier, log_score: of the model; `_base_rate`: of the base rate of the other flights; `_in_sample`: of
            all. `_ci95`: 95 % interval.
        brier_if_right: what the probabilities expect of themselves.
        brier_gain: brier - brier_base_rate; negative: the model knows something. None where all flights ended
            alike: a base rate that has seen nothing else is sure of it, and nobody could have been.
        auc_four: probability that a landing on four had a higher probability of it than one that was none;
            None where all or none landed on four. auc_four_ci95: None also where all such pairs are alike.
        counts: of four, two, none (:data:`..labels.CLASS_NAMES`).
        reliability: of the probability of four legs.
    """

    flights: int
    brier: float
    brier_ci95: Interval
    brier_if_right: ExpectedBrier
    brier_base_rate: float
    brier_base_rate_in_sample: float
    brier_gain: float | None
    brier_gain_ci95: Interval | None
    log_score: float
    log_score_ci95: Interval
    log_score_base_rate: float
    auc_four: float | None
    auc_four_ci95: Interval | None
    counts: dict[str, Count]
    reliability: tuple[Bin, ...]

    def json_shape(self) -> dict[str, Any]:
        """The ``score`` of the document ``perchhw.gap_landings/1``."""
        document = dict(vars(self))
        counts, reliability = document.pop("counts"), document.pop("reliability")
        right = document.pop("brier_if_right")
        document |= {
            "brier_expected": right.mean,
            "brier_expected_ci95": right.ci95,
            "brier_p_value": right.p_value,
        }
        for name, key in zip(self.counts, ("four_leg", "two_leg", "none"), strict=True):
            document[f"{key}_share_real"] = self.counts[name].real / self.flights
            document[f"{key}_share_model"] = self.counts[name].expected / self.flights
        return {**document, "counts": counts, "reliability": reliability}


def base_rates(real: IntArray, folds: IntArray | None = None, classes: int = 3) -> FloatArray:
    """Frequencies (n, classes) of the classes among the flights of other folds (default: all others)."""
    happened = np.eye(classes)[real]
    groups = np.arange(real.size) if folds is None else folds
    out = np.empty((real.size, classes))
    for group in np.unique(groups):
        own = groups == group
        out[own] = happened[~own].mean(axis=0) if not own.all() else 1.0 / classes
    return out


def score(probability: FloatArray, real: IntArray, draws: int, rng: np.random.Generator) -> Score:
    """Score probabilities.

    Args:
        probability: (n, 3), of four legs, two, none. real: (n,), the class that happened.
        draws: landings behind each probability: one that never happened in them is not impossible.
        rng: draws flights; outcomes have a stream of their own.
    """
    count = len(real)
    happened, base = np.eye(3)[real], base_rates(real)
    own, by_base = brier(probability, real), brier(base, real)
    surprises, gain = surprise(probability, real, draws), own - by_base
    drawn = drawn_again(count, REPLICATES, rng)
    alike = ended_alike(real)
    auc = auc_of(probability[:, 0], real == 0)
    return Score(
        flights=count,
        brier=float(own.mean()),
        brier_ci95=interval_of(own[drawn].mean(axis=1)),
        brier_if_right=expected_brier(probability, real, draws, rng.spawn(1)[0]),
        brier_base_rate=float(by_base.mean()),
        brier_base_rate_in_sample=float(brier(np.tile(happened.mean(axis=0), (count, 1)), real).mean()),
        brier_gain=None if alike else float(gain.mean()),
        brier_gain_ci95=None if alike else interval_of(gain[drawn].mean(axis=1)),
        log_score=float(surprises.mean()),
        log_score_ci95=interval_of(surprises[drawn].mean(axis=1)),
        log_score_base_rate=float(surprise(base, real, count).mean()),
        auc_four=auc,
        auc_four_ci95=auc_interval(probability[:, 0], real == 0, drawn),
        counts=_counts(probability, real),
        reliability=reliability(probability[:, 0], real == 0),
    )


def ended_alike(real: IntArray) -> bool:
    """Whether only one class happened."""
    return bool((real == real[0]).all())


def brier(probability: FloatArray, real: IntArray) -> FloatArray:
    """Brier score (n,) of each flight."""
    return np.asarray(((probability - np.eye(3)[real]) ** 2).sum(axis=1))


def smoothed(probability: FloatArray, draws: int | IntArray) -> FloatArray:
    """Probabilities (n, k) with each class counted once more than it was drawn (Laplace's rule of
    succession): what never happened in some hundred landings is not impossible. `draws`: of all flights, or
    of each (n, 1)."""
    return np.asarray((probability * draws + 1.0) / (draws + probability.shape[-1]))


def surprise(probability: FloatArray, real: IntArray, draws: int | IntArray) -> FloatArray:
    """-ln of the probability of what happened (n,), :func:`smoothed`."""
    return np.asarray(-np.log(smoothed(probability, draws)[np.arange(len(real)), real]))


def expected_brier(
    probability: FloatArray, real: IntArray, draws: int, rng: np.random.Generator
) -> ExpectedBrier:
    """What the Brier score is where the probabilities are right, and how often it is as bad as the real one.

    The log score notices shuffled and overconfident probabilities of 28 flights as often (within 0.05), but
    what one landing of a class that was never drawn costs it hangs on how many were drawn: -ln of one over
    that. It costs the Brier score 2 at most, and is as likely here as smoothing says.

    Args:
        probability: (n, 3). real: (n,), the class that happened. draws: landings behind each probability.
        rng: draws outcomes.
    """
    flights = np.arange(len(real))
    if_class = np.stack([brier(probability, np.full(len(real), k)) for k in range(3)], axis=1)
    edges = np.cumsum(smoothed(probability, draws), axis=1)
    drawn = rng.random((DRAWN_OUTCOMES, len(real)))
    landed = np.add(drawn > edges[:, 0], drawn > edges[:, 1], dtype=np.int64)
    scores = if_class[flights, landed].mean(axis=1)
    own = if_class[flights, real].mean()
    as_bad = int(np.sum(scores >= own - _ROUNDING))
    return ExpectedBrier(
        mean=float(scores.mean()),
        ci95=interval_of(scores),
        p_value=(1 + as_bad) / (1 + DRAWN_OUTCOMES),
    )


def auc_of(value: FloatArray, positive: BoolArray) -> float | None:
    """Probability that a positive has a larger value than another, ties by half; None without both."""
    yes, no = value[positive], value[~positive]
    if not yes.size or not no.size:
        return None
    return float(np.mean(_wins(yes, no)))


def count_interval(
    probability: FloatArray, level: float = 0.8, share: FloatArray | None = None
) -> tuple[int, int]:
    """Central interval of how many of n events happen (Poisson binomial).

    Args:
        probability: (n,), of independent events; or (m, n), of m vehicles.
        level: of the interval.
        share: (m,), of the vehicles: what is not known of the vehicle widens the interval of all flights
            together, because it is the same in each.
    """
    mass = _count_mass(np.atleast_2d(probability))
    reached = np.cumsum(mass[0] if share is None else share @ mass)
    tail = 0.5 * (1.0 - level)
    return int(np.searchsorted(reached, tail)), int(np.searchsorted(reached, 1.0 - tail))


def _count_mass(rows: FloatArray) -> FloatArray:
    """Probabilities (m, n + 1) of each number of n independent events, of m vehicles (m, n)."""
    mass = np.zeros((len(rows), rows.shape[1] + 1))
    mass[:, 0] = 1.0
    for p in rows.T[:, :, None]:
        mass[:, 1:] = mass[:, 1:] * (1.0 - p) + mass[:, :-1] * p
        mass[:, :1] *= 1.0 - p
    return mass


def reliability(probability: FloatArray, happened: BoolArray) -> tuple[Bin, ...]:
    """Bins of equal count, by rising probability."""
    order = np.argsort(probability, kind="stable")
    bins = []
    for rows in np.array_split(order, min(BINS, len(order))):
        hits, count = int(np.sum(happened[rows])), len(rows)
        bins.append(Bin(count, float(np.mean(probability[rows])), hits / count, wilson_interval(hits, count)))
    return tuple(bins)


def count_of(probability: FloatArray, happened: BoolArray) -> Count:
    """How often something happened, beside its probabilities (n,)."""
    real = int(np.sum(happened))
    mass = _count_mass(probability[None, :])[0]
    tail = float(min(mass[: real + 1].sum(), mass[real:].sum()))
    return Count(real, float(probability.sum()), count_interval(probability), min(1.0, 2.0 * tail))


def _counts(probability: FloatArray, real: IntArray) -> dict[str, Count]:
    return {
        name: count_of(shares, real == k)
        for k, (name, shares) in enumerate(zip(CLASS_NAMES, probability.T, strict=True))
    }


def auc_interval(value: FloatArray, positive: BoolArray, drawn: IntArray) -> Interval | None:
    """Of the drawn sets that have both: a pair counts as often as both of its flights were drawn.

    None where all pairs are alike, as where there are none: no set that is drawn from such flights could show
    what others would.
    """
    wins = _wins(value[positive], value[~positive])
    if not wins.size or (wins == wins.flat[0]).all():
        return None
    times = np.zeros((len(drawn), value.size))
    np.add.at(times, (np.arange(len(drawn))[:, None], drawn), 1.0)
    yes, no = times[:, positive], times[:, ~positive]
    pairs = yes.sum(axis=1) * no.sum(axis=1)
    won = ((yes @ wins) * no).sum(axis=1)
    return interval_of(won[pairs > 0.0] / pairs[pairs > 0.0])


def _wins(yes: FloatArray, no: FloatArray) -> FloatArray:
    """1 where the row's value is larger than the column's, 0.5 where they are the same."""
    difference = yes[:, None] - no[None, :]
    return (difference > 0.0) + 0.5 * (difference == 0.0)
