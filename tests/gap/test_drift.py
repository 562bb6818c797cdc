"""Quiet and hard flying disagree about a number: which names that costs, and what its interval becomes."""

import numpy as np
import pytest

from calibration.gap.estimate.acceptance import drift, drifting
from calibration.gap.estimate.mixed import FIRST_SPREAD, MixedFit, Products
from calibration.gap.estimate.model import Model, Variable
from calibration.gap.estimate.nuisances import NUISANCES
from calibration.gap.estimate.refine import Fitted
from calibration.gap.estimate.regression import LinearisedFit, Noise
from calibration.gap.estimate.unstated import prior_of_unstated
from onboard.vehicle import load_vehicle

X, Z = Variable("body_drag", "area_x"), Variable("body_drag", "area_z")
SIZE, PARTS = 3e-3, 8
CERTAIN, DOUBTFUL = 1e-4, 1e-3
"""m2: the true size, of which the first is 900 and the second 9 squared standard errors."""


def offered(difference: float) -> Fitted:
    """A fit to quiet and hard parts that agree about area_x, and differ by so much (m2) about area_z."""
    model = Model(load_vehicle("crazyflie21-stock"), {X: SIZE, Z: SIZE})
    own = np.zeros((PARTS, 2))
    own[:, 1] = np.repeat([-0.5, 0.5], PARTS // 2) * difference
    weights = np.repeat([1.0, 1.01], PARTS // 2)[:, None] * [1e10, 1e10]
    information = np.einsum("pg,gh->pgh", weights, np.eye(2))
    nothing, q = np.zeros((PARTS, len(NUISANCES))), len(NUISANCES)
    mixed = MixedFit(np.zeros(2), np.eye(2), FIRST_SPREAD, nothing, information, weights * own)
    products = Products(
        np.zeros((PARTS, q, q)), np.zeros((PARTS, q, 2)), information,
        nothing, weights * own, np.zeros(PARTS), np.zeros(PARTS),
    )  # fmt: skip
    estimate = LinearisedFit(mixed, products, (products,) * 3, Noise(np.zeros((7, 16)), np.ones(7)), nothing)
    likelihoods = (np.zeros((3, PARTS)),) * 2
    folds, columns = np.zeros(PARTS, dtype=int), (nothing, nothing)
    return Fitted(
        model, (X, Z), estimate, *likelihoods, folds, nothing, columns, unstated=prior_of_unstated(0)
    )


def test_a_number_that_makes_the_name_and_drifts_costs_it() -> None:
    assert drifting((X, Z), offered(SIZE), {X: DOUBTFUL, Z: CERTAIN}) == (Z,)
    assert drifting((X, Z), offered(SIZE), {X: CERTAIN, Z: CERTAIN}) == (Z,)


def test_one_number_of_several_that_drifts_costs_no_name_that_the_others_make() -> None:
    assert drifting((X, Z), offered(SIZE), {X: CERTAIN, Z: DOUBTFUL}) == ()


def test_what_quiet_and_hard_flying_disagree_by() -> None:
    fitted = offered(SIZE)
    assert drift(Z, fitted) == pytest.approx(SIZE)
    assert drift(X, fitted) == 0.0
    assert drift(Z, offered(0.3 * SIZE)) == 0.0  # within what is believed of one size
