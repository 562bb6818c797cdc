"""Four motors and a scale of thrust: no number without a meaning; names that were withdrawn are missing."""

import numpy as np
import pytest

from calibration.gap.estimate.acceptance import clustered_errors, judge
from calibration.gap.estimate.mixed import Prior
from calibration.gap.estimate.model import Model, Variable
from calibration.gap.estimate.refine import refine, training_set
from calibration.gap.estimate.shared_nuisances import shared_nuisances
from calibration.gap.search.always import LOG_TIMING, MADE_SCALE
from calibration.gap.search.forward import Search
from calibration.gap.search.naming import as_believed, name_effects
from calibration.gap.search.rivals import without
from calibration.gap.search.selection import SelectionStep
from tests.gap.mujoco_flights import flights, frame
from tests.truth.airframe import nominal
from tests.truth.mujoco_room import Hidden

MOTORS = tuple(Variable("motor_imbalance", motor) for motor in ("m1", "m2", "m3", "m4"))
UNEQUAL = (1.03, 0.96, 1.02, 0.99)


def test_a_tie_says_what_the_flights_cannot() -> None:
    flat = Prior.independent(np.zeros(2), np.full(2, 1e-6))
    tied = flat.tied(np.array([0.5, 0.5]), 3.0, 0.1)
    difference = 1e4 * np.array([[1.0, -1.0], [-1.0, 1.0]])  # known, and 4: the sum is not
    matrix = difference + tied.precision
    values = np.linalg.solve(matrix, difference @ np.array([2.0, -2.0]) + tied.precision @ tied.mean)
    np.testing.assert_allclose(values, [5.0, 1.0], atol=1e-3)
    np.testing.assert_allclose(np.sqrt(np.diag(np.linalg.inv(matrix))), 0.1, rtol=1e-2)


@pytest.mark.further
def test_each_motor_is_known_beside_a_scale_of_thrust() -> None:
    model = Model(nominal(frame(), "gauge"))
    training = training_set(flights(Hidden(motors=UNEQUAL)), model)
    fitted = refine(model, (MADE_SCALE, *MOTORS), training)
    errors = clustered_errors(fitted, training)
    found = np.array([fitted.model.values[motor] for motor in MOTORS])
    assert found.mean() == pytest.approx(1.0, abs=2e-3)
    np.testing.assert_allclose(found, UNEQUAL, atol=5e-3)
    assert max(errors[motor] for motor in MOTORS) < 0.01


@pytest.mark.further
def test_what_a_name_is_needed_for_does_not_depend_on_where_a_fit_began() -> None:
    """Nuisances that had nothing to explain beside a name are small; its noise must not take their place."""
    model = Model(nominal(frame(), "gauge"))
    training = training_set(flights(Hidden(motors=UNEQUAL)), model)
    named = refine(model, (LOG_TIMING, *MOTORS), training)
    reduced, never = without(named, training, "motor_imbalance"), refine(model, (LOG_TIMING,), training)
    assert float(reduced.gains(never, False).sum()) == pytest.approx(0.0, abs=2.0)
    missing = {shared.name for shared in shared_nuisances(never, model.base)}
    assert {"torque_trim_x", "torque_trim_y"} <= missing
    assert {shared.name for shared in shared_nuisances(reduced, model.base)} == missing


@pytest.mark.further
def test_what_loses_its_name_is_missing_again() -> None:
    vehicle = nominal(frame(), "gauge")
    model, rng = Model(vehicle), np.random.default_rng(1)
    training = training_set(flights(Hidden(motors=UNEQUAL)), model)
    first = refine(model, (LOG_TIMING,), training)
    final = refine(model, (LOG_TIMING, *MOTORS), training)
    step = SelectionStep("motor_imbalance", judge(first, final, MOTORS, training, rng), final)
    found = Search(first, (step,), final, {}, {}, (), ())
    names = name_effects(found, training)
    assert names.effects == ("motor_imbalance",)
    assert as_believed(found, names, training) is found.final
    believed = as_believed(found, names.without_any("withdrawn"), training)
    told = {shared.name for shared in shared_nuisances(believed, vehicle)}
    assert {"torque_trim_x", "torque_trim_y"} & told
    assert not shared_nuisances(found.final, vehicle)
