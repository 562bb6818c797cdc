"""Flights kept back refuse nothing by torques that answer noise, nor by a law that they do not tell."""

import dataclasses

import numpy as np
import pytest

from calibration.gap.data.excitation import only_excited
from calibration.gap.data.signals import TORQUE
from calibration.gap.estimate.model import Model, Variable
from calibration.gap.estimate.refine import Fitted, refine, training_set
from calibration.gap.estimate.unstated import AXES
from calibration.gap.search.always import LOG_TIMING
from calibration.gap.search.retest import on_unseen, unseen_set, where_it_shows
from tests.gap.mujoco_flights import CALM, flights, frame
from tests.truth.airframe import nominal
from tests.truth.mujoco_room import Hidden

STOCK = Model(nominal(frame(), "kept back"))


def shares(fit: Fitted) -> np.ndarray:
    """Of what each other law of the motors changes."""
    return fit.estimate.fit.theta[len(fit.variables) + AXES : fit.first_unnamed]


@pytest.mark.further
def test_flights_kept_back_have_the_law_that_the_others_told() -> None:
    """An eight by itself tells none, and would take for a law what a lag does."""
    eight, *others = flights(Hidden(), dataclasses.replace(CALM, speed_law=True))
    fit = refine(STOCK, (LOG_TIMING,), training_set(others, STOCK))
    unseen = unseen_set([eight], fit.model, training_set(others, STOCK))
    assert shares(on_unseen(unseen, fit.model, fit, fit)) == pytest.approx(shares(fit), abs=0.05)
    alone = refine(fit.model, (), training_set([eight], fit.model), iterations=1)
    assert np.abs(shares(alone) - shares(fit)).max() > 0.3


@pytest.mark.further
def test_torques_of_flights_kept_back_count_where_most_of_the_motion_was_commanded() -> None:
    records = flights(Hidden())
    training = training_set(records, STOCK)
    every = training.regression.weights
    counted = unseen_set(records, STOCK, training).regression.weights
    quiet = every < 0.5
    assert quiet.any()
    assert not quiet.all()
    assert not counted[quiet].any()
    assert np.array_equal(counted[~quiet], every[~quiet])
    assert np.array_equal(only_excited(counted), counted)


def test_torques_count_where_two_models_differ_by_more_than_may_be_answers() -> None:
    """Eights once refused an inertia that shakes had shown to 1 %."""
    records = flights(Hidden())
    unseen = unseen_set(records, STOCK, training_set(records, STOCK))
    weights = unseen.regression.weights[:, TORQUE]
    answered, shaken = ((weights > 0.0) & (weights < 0.9)).any(axis=1), (weights > 0.98).any(axis=1)
    assert answered.any()
    assert shaken.any()

    def counted(larger: float) -> np.ndarray:
        inertias = {Variable("inertia_error", axis): larger for axis in ("xx", "yy", "zz")}
        return where_it_shows(unseen, STOCK.with_values(inertias), STOCK).regression.weights[:, TORQUE]

    assert np.array_equal(counted(0.9), weights)
    a_twentieth = counted(0.05)
    assert not a_twentieth[(weights > 0.0) & (weights < 0.9)].any()
    assert np.array_equal(a_twentieth[weights > 0.98], weights[weights > 0.98])


@pytest.mark.further
def test_a_single_flight_of_shakes_that_is_kept_back_counts() -> None:
    """By itself none of its parts is quiet; a moment that grows with the speed once lost its name by that."""
    eight, shake, climbs = flights(Hidden())
    counted = unseen_set([shake], STOCK, training_set([eight, climbs], STOCK)).regression.weights
    assert np.all(counted[:, TORQUE.start : TORQUE.start + 2] > 0.9)
    alone = training_set([shake], STOCK).regression.weights
    assert np.median(alone[:, TORQUE.start]) < 0.1


@pytest.mark.further
def test_a_moment_holds_on_a_flight_harder_than_those_that_told_it() -> None:
    """Each model under a noise of its own, the one without the moment won on a flight of shakes by 107."""
    eight, shake, climbs = flights(Hidden(velocity_moment=(2e-4, -2e-4)))
    moment = tuple(Variable("velocity_moment", axis) for axis in ("roll", "pitch"))
    training = training_set([eight, climbs], STOCK)
    final = refine(STOCK, (LOG_TIMING, *moment), training)
    reduced = refine(STOCK, (LOG_TIMING,), training)
    unseen = unseen_set([shake], STOCK, training)
    with_it, without_it = (on_unseen(unseen, one.model, final, one) for one in (final, reduced))
    assert float(with_it.gains(without_it, in_time=False).sum()) > 100.0
