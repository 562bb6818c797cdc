"""Shared effects and nuisances of each flight are told apart, with honest errors."""

import dataclasses

import numpy as np
import pytest

from calibration.gap.estimate.mixed import (
    FIRST_SPREAD,
    Prior,
    Products,
    fit_mixed,
    held_out_likelihood,
    jackknife_errors,
)
from calibration.gap.estimate.nuisances import NUISANCES

ROWS, PARTS, SPREAD, LEVEL, THETA = 80, 24, 0.03, 0.025, 0.4
FLAT = Prior.independent(np.zeros(1), np.array([1e-9]))
NONE = Prior.independent(np.zeros(0), np.zeros(0))


def products(rng: np.random.Generator, mean: float = 0.0, theta: float = THETA) -> Products:
    """Products of `PARTS` parts with one effect and one nuisance; the other nuisances touch nothing."""
    q = len(NUISANCES)
    sums = np.zeros((PARTS, q + 2, q + 2))
    for part in range(PARTS):
        table = np.zeros((q + 2, ROWS))
        table[0] = 10.0
        table[q] = rng.normal(size=ROWS)
        nuisance = mean + SPREAD * rng.normal()
        table[-1] = theta * table[q] + nuisance * table[0] + rng.normal(size=ROWS)
        sums[part] = table @ table.T
    return Products(
        zz=sums[:, :q, :q], zx=sums[:, :q, q:-1], xx=sums[:, q:-1, q:-1], zr=sums[:, :q, -1],
        xr=sums[:, q:-1, -1], rr=sums[:, -1, -1], constant=np.zeros(PARTS),
    )  # fmt: skip


def drawn(rng: np.random.Generator, mean: float = 0.0) -> tuple[Products, np.ndarray, np.ndarray, np.ndarray]:
    """Parts with a level of their flight about `mean`; products, rows of effect, nuisance and residual."""
    q, flights = len(NUISANCES), PARTS // 4
    effect = rng.normal(size=(PARTS, ROWS)) + np.tile([1.0, 0.5, 0.2, 0.0], flights)[:, None]
    nuisance = 10.0 + 0.1 * rng.normal(size=(PARTS, ROWS))
    levels = mean + np.repeat(LEVEL * rng.normal(size=flights), 4) + SPREAD * rng.normal(size=PARTS)
    residual = THETA * effect + levels[:, None] * nuisance + rng.normal(size=(PARTS, ROWS))
    table = np.zeros((PARTS, q + 2, ROWS))
    table[:, 0], table[:, q], table[:, -1] = nuisance, effect, residual
    sums = table @ np.swapaxes(table, 1, 2)
    made = Products(
        zz=sums[:, :q, :q], zx=sums[:, :q, q:-1], xx=sums[:, q:-1, q:-1], zr=sums[:, :q, -1],
        xr=sums[:, q:-1, -1], rr=sums[:, -1, -1], constant=np.zeros(PARTS),
    )  # fmt: skip
    return made, effect, nuisance, residual


def test_a_level_of_each_flight_is_integrated_out_exactly() -> None:
    """Against the covariance of all rows of a flight, written out."""
    p, effect, nuisance, residual = drawn(np.random.default_rng(7))
    spread = FIRST_SPREAD.copy()
    spread[0], spread[len(NUISANCES)] = 0.05, 0.4
    information, score, likelihood = 0.0, 0.0, 0.0
    for flight in range(PARTS // 4):
        rows = slice(4 * flight, 4 * flight + 4)
        by_part = np.zeros((4, ROWS, 4))
        by_part[range(4), :, range(4)] = nuisance[rows]
        own, whole = by_part.reshape(4 * ROWS, 4), nuisance[rows].ravel()
        covariance = np.eye(4 * ROWS) + 0.05**2 * own @ own.T + 0.4**2 * np.outer(whole, whole)
        x, r = effect[rows].ravel(), residual[rows].ravel()
        weighed = np.linalg.solve(covariance, np.column_stack([x, r]))
        information += float(x @ weighed[:, 0])
        score += float(x @ weighed[:, 1])
        likelihood -= 0.5 * float(r @ weighed[:, 1] + np.linalg.slogdet(covariance)[1])
    fit = fit_mixed(p, FLAT, spread, keep_spread=True)
    assert fit.information.sum() == pytest.approx(information)
    assert np.all(fit.information >= 0.0)
    assert fit.theta[0] == pytest.approx(score / information)
    bare = p.of([])
    kept = fit_mixed(bare, NONE, spread, keep_spread=True)
    assert held_out_likelihood(bare, kept, NONE, np.zeros(PARTS)).sum() == pytest.approx(likelihood)


def test_spreads_over_flights_and_over_their_parts_are_told_apart() -> None:
    rng = np.random.default_rng(8)
    spreads = np.array([fit_mixed(drawn(rng)[0], FLAT).spread for _ in range(20)])
    assert np.mean(spreads[:, len(NUISANCES)]) == pytest.approx(LEVEL, rel=0.2)
    assert np.mean(spreads[:, 0]) == pytest.approx(SPREAD, rel=0.2)


def test_a_mean_of_all_flights_is_no_scatter_between_them() -> None:
    fits = [fit_mixed(drawn(np.random.default_rng([9, n]), mean=0.1)[0], FLAT) for n in range(20)]
    assert np.mean([fit.spread[len(NUISANCES)] for fit in fits]) < 1.2 * LEVEL
    assert np.mean([fit.per_part[:, 0].mean() for fit in fits]) == pytest.approx(0.1, abs=0.01)


def test_effect_and_spread_of_the_nuisance_are_found() -> None:
    rng = np.random.default_rng(3)
    fits = [fit_mixed(products(rng), FLAT) for _ in range(60)]
    thetas = np.array([fit.theta[0] for fit in fits])
    errors = np.array([np.sqrt(fit.covariance[0, 0]) for fit in fits])
    assert thetas.mean() == pytest.approx(THETA, abs=3 * thetas.std() / np.sqrt(60))
    assert errors.mean() == pytest.approx(thetas.std(), rel=0.3)
    assert np.mean([fit.spread[0] for fit in fits]) == pytest.approx(SPREAD, rel=0.15)


def test_leaving_out_flights_agrees_with_the_scatter_of_repeats() -> None:
    rng = np.random.default_rng(4)
    thetas, errors = [], []
    for _ in range(40):
        fit = fit_mixed(products(rng), FLAT)
        thetas.append(fit.theta[0])
        errors.append(jackknife_errors(fit, FLAT, np.arange(PARTS) // 2)[0])
    assert np.mean(errors) == pytest.approx(np.std(thetas), rel=0.35)


def test_leaving_out_clusters_of_a_mean_gives_its_standard_error() -> None:
    values = np.array([1.0, 4.0, 2.0, 7.0])
    fit = dataclasses.replace(
        fit_mixed(products(np.random.default_rng(1)), FLAT),
        theta=np.array([values.mean()]),
        information=np.ones((4, 1, 1)),
        score=values[:, None],
    )
    told = jackknife_errors(fit, Prior.independent(np.zeros(1), np.full(1, 1e-12)), np.arange(4))
    assert told[0] == pytest.approx(values.std(ddof=1) / 2.0)


def test_held_out_likelihood_rises_with_a_true_effect_and_not_with_a_placebo() -> None:
    rng = np.random.default_rng(5)
    folds = np.arange(PARTS) % 4

    def gain(theta: float) -> float:
        p = products(rng, theta=theta)
        with_effect = held_out_likelihood(p, fit_mixed(p, FLAT), FLAT, folds).sum()
        bare = p.of([])
        return float(with_effect - held_out_likelihood(bare, fit_mixed(bare, NONE), NONE, folds).sum())

    assert gain(THETA) > 50.0
    assert np.mean([gain(0.0) for _ in range(30)]) < 0.5


def test_what_is_believed_beforehand_counts_where_flights_say_little_and_not_where_they_say_much() -> None:
    p = products(np.random.default_rng(6))
    flights = fit_mixed(p, FLAT)
    error = float(np.sqrt(flights.covariance[0, 0]))
    believed = [
        fit_mixed(p, Prior.independent(np.array([2.0]), np.array([(error * s) ** -2.0])))
        for s in (0.01, 1, 100)
    ]
    assert believed[0].theta[0] == pytest.approx(2.0, abs=1e-3)
    assert believed[1].theta[0] == pytest.approx(0.5 * (flights.theta[0] + 2.0), abs=0.05)
    assert believed[2].theta[0] == pytest.approx(flights.theta[0], abs=0.1 * error)
    assert believed[1].covariance[0, 0] == pytest.approx(0.5 * error**2, rel=0.1)
