"""Flights predicted from other flights alone, by the vehicles of a grid: one left out, and each half from the
other.

A prediction is the mean over the posterior of the vehicles (:func:`posterior`).
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from calibration.gap.landings.outcomes.labels import CLASS_NAMES
from calibration.gap.landings.outcomes.scores import REPLICATES, auc_of, base_rates, brier, count_interval
from calibration.measurement import Interval, drawn_again, interval_of
from onboard.arrays import BoolArray, FloatArray, IntArray

SPLITS = 20
"""Ways of cutting the flights into halves: one alone says much about its own luck."""


@dataclass(frozen=True)
class HalfScore:
    """Flights predicted from a half that they are not in, with the base rate of that half beside it.

    Attributes:
        brier, brier_base_rate: mean over flights and splits.
        brier_gain: their difference. brier_gain_ci95: 95 %, flights drawn again.
        auc_four: mean over splits; None where a split has no such flights.
        inside80: share of the halves whose numbers of four, two, none lie in the 80 % interval that the other
            half predicts of them.
    """

    brier: float
    brier_base_rate: float
    brier_gain: float
    brier_gain_ci95: Interval
    auc_four: float | None
    inside80: dict[str, float]


def posterior(logs: FloatArray, rows: BoolArray) -> FloatArray:
    """Shares (points,) of vehicles after the flights `rows` (n,), from ln p of what happened (points, n)."""
    total = logs[:, rows].sum(axis=1)
    weight = np.exp(total - total.max())
    return np.asarray(weight / weight.sum())


def left_one_out(table: FloatArray, logs: FloatArray) -> FloatArray:
    """Predictions (n, 3) of each flight from all others.

    Args:
        table: what the vehicles predict (points, n, 3). logs: ln p of what happened (points, n).
    """
    others = logs.sum(axis=1, keepdims=True) - logs
    weight = np.exp(others - others.max(axis=0))
    return np.asarray(np.einsum("pn,pnk->nk", weight, table) / weight.sum(axis=0)[:, None])


def held_out(
    table: FloatArray, logs: FloatArray, real: IntArray, own: BoolArray
) -> tuple[FloatArray, list[bool]]:
    """Flights as the others predict them.

    Args:
        table, logs: as for :func:`left_one_out`. real: classes (n,). own: the flights (n,).

    Returns:
        Probabilities (k, 3), and whether the numbers of four, two, none are as the others say (80 %).
    """
    share = posterior(logs, ~own)
    happened = np.bincount(real[own], minlength=3)
    intervals = [count_interval(table[:, own, k], share=share) for k in range(3)]
    inside = [low <= count <= high for count, (low, high) in zip(happened, intervals, strict=True)]
    return np.tensordot(share, table[:, own], 1), inside


def half_score(
    real: IntArray,
    predict: Callable[[BoolArray], tuple[FloatArray, list[bool]]],
    rng: np.random.Generator,
) -> HalfScore:
    """Score each half of the flights as predicted from the other, SPLITS times.

    Args:
        real: classes (n,). predict: what the others say of some flights (n,), as :func:`held_out`.
        rng: draws halves, and flights.
    """
    own, base, areas = np.empty((SPLITS, real.size)), np.empty((SPLITS, real.size)), []
    inside = []
    for split in range(SPLITS):
        folds = rng.permutation(np.arange(real.size) % 2)
        predicted = np.empty((real.size, 3))
        for half in (folds == 0, folds == 1):
            predicted[half], held = predict(half)
            inside.append(held)
        own[split], base[split] = brier(predicted, real), brier(base_rates(real, folds), real)
        areas.append(auc_of(predicted[:, 0], real == 0))
    change = (own - base).mean(axis=0)
    known = [area for area in areas if area is not None]
    return HalfScore(
        brier=float(own.mean()),
        brier_base_rate=float(base.mean()),
        brier_gain=float(change.mean()),
        brier_gain_ci95=interval_of(change[drawn_again(real.size, REPLICATES, rng)].mean(axis=1)),
        auc_four=float(np.mean(known)) if known else None,
        inside80=dict(zip(CLASS_NAMES, map(float, np.mean(inside, axis=0)), strict=True)),
    )
