"""Inertias of which yaw's is known badly are still those of a body, and cost no other name."""

import dataclasses
from functools import cache

import pytest

from calibration.gap.estimate.acceptance import clustered_errors
from calibration.gap.estimate.model import Model, Variable
from calibration.gap.estimate.refine import Fitted, Training, refine, training_set
from calibration.gap.search.forward import Search
from calibration.gap.search.naming import name_effects, not_loaded
from calibration.gap.search.rigid_body import as_a_rigid_body
from calibration.gap.search.selection import SelectionStep
from tests.gap.test_conclusion import STOCK, flown

XX, YY, ZZ = (Variable("inertia_error", axis) for axis in ("xx", "yy", "zz"))
OFFSET = (Variable("com_offset", "x"), Variable("com_offset", "y"))
FLAT = {XX: -0.14, YY: -0.14, ZZ: -0.04}


@cache
def lighter() -> tuple[Fitted, Training]:
    """A body that is nearly flat, with its weight 1 mm ahead; nobody turns about the vertical."""
    truth = Model(STOCK, {**FLAT, OFFSET[0]: 1e-3, OFFSET[1]: 0.0})
    training = training_set(flown(truth.vehicle()), Model(STOCK))
    return refine(Model(STOCK), (XX, YY, ZZ, *OFFSET), training), training


def with_yaw_inertia(standard_errors: float) -> Fitted:
    """The fit with an inertia about z that is so far beyond the largest that a body with the others has."""
    fitted, training = lighter()
    body, model = STOCK.body, fitted.model
    largest = (
        sum(getattr(body, f"inertia_{v.parameter}").value * (1.0 + model.values[v]) for v in (XX, YY))
        / body.inertia_zz.value
    )
    error = clustered_errors(fitted, training)[ZZ]
    return dataclasses.replace(fitted, model=model.with_values({ZZ: largest - 1.0 + standard_errors * error}))


@pytest.mark.parametrize("standard_errors", [0.5, 2.5])
def test_the_nearest_body_moves_what_is_known_least(standard_errors: float) -> None:
    training, impossible = lighter()[1], with_yaw_inertia(standard_errors)
    assert not_loaded(impossible.model.vehicle()) is not None
    fitted = as_a_rigid_body(impossible, training)
    assert not_loaded(fitted.model.vehicle()) is None
    moved = {v: abs(fitted.model.values[v] - impossible.model.values[v]) for v in fitted.variables}
    errors = clustered_errors(impossible, training)
    assert all(moved[v] < 3.0 * errors[v] for v in fitted.variables)
    assert moved[ZZ] > 3.0 * max(moved[XX], moved[YY])  # roll and pitch are known far better


def test_what_is_a_body_stays_as_it_is_and_what_is_far_from_one_too() -> None:
    training = lighter()[1]
    for standard_errors in (-1.0, 6.0):
        fitted = with_yaw_inertia(standard_errors)
        assert as_a_rigid_body(fitted, training) is fitted


def test_inertias_that_no_body_has_cost_no_other_name() -> None:
    training, fitted = lighter()[1], with_yaw_inertia(6.0)
    steps = [
        SelectionStep(effect, None, fitted)  # type: ignore[arg-type]  # how it came in is asked of nobody here
        for effect in ("com_offset", "inertia_error")
    ]
    for order in (steps, steps[::-1]):
        names = name_effects(Search(fitted, tuple(order), fitted, {}, {}, (), ()), training)
        assert names.effects == ("com_offset",)
        assert "no rigid body" in names.rejected["inertia_error"]
