"""Thrust that falls within a flight is an effect, though each part of a flight has a scale of its own."""

import dataclasses
from functools import cache

import numpy as np
import pytest

from calibration.gap.data.signals import PARTS
from calibration.gap.estimate.acceptance import LEAST_GAIN, Judgement, clustered_errors, judge
from calibration.gap.estimate.model import Model, Variable
from calibration.gap.estimate.refine import Fitted, Training, refine, training_set
from calibration.gap.estimate.shared_nuisances import SharedNuisance, every_mean, shared_nuisances
from calibration.gap.search.candidates import candidates_for
from calibration.gap.search.retest import shared_by
from calibration.gap.search.screen import screen
from onboard.quantity import Quantity
from onboard.vehicle import Effect, Vehicle, load_vehicle
from tests.gap.simulated_flight import circle, fly, up_and_down, with_noise

STOCK = load_vehicle("crazyflie21-stock")
LOSS, TIME = Variable("motor_warming", "loss"), Variable("motor_warming", "time_constant")
HIDDEN = {LOSS: 0.03, TIME: 8.0}


def with_effects(values: dict[Variable, float]) -> Vehicle:
    return Model(STOCK, values).vehicle()


@cache
def training(warming: bool) -> Training:
    """Seven flights of 24 s, each with a scale of thrust of its own."""
    rng = np.random.default_rng(3)
    paths = (circle(), up_and_down(), circle(period=3.0), up_and_down(period=2.0), circle(radius=0.4))
    records = []
    for n, path in enumerate((*paths, *paths[:2])):
        scale = Effect(
            name="thrust_scale", parameters={"scale": Quantity(rng.normal(1.0, 0.005), "1", 0.0, "hidden")}
        )
        hidden = with_effects(HIDDEN if warming else {})
        truth = dataclasses.replace(hidden, effects=(*hidden.effects, scale))
        record = fly(truth, path, 24.0, shape=f"shape {n % 5}", name=f"flight {n}", believed=STOCK)
        records.append(with_noise(record, 0.5, rng))
    return training_set(records, Model(STOCK))


def fitted(warming: bool) -> tuple[Fitted, Fitted, Judgement]:
    """Without the effect, with it, and what is to be thought of it."""
    flights = training(warming)
    none = refine(Model(STOCK), (), flights)
    found = refine(Model(STOCK), (LOSS, TIME), flights)
    return none, found, judge(none, found, (LOSS, TIME), flights, np.random.default_rng(1))


def shared_courses(fit: Fitted) -> list[SharedNuisance]:
    return [one for one in shared_nuisances(fit, STOCK) if one.name.endswith("at first")]


def fall(fit: Fitted) -> float:
    """How far the scales of the parts of a flight fall from the first to the last, on average."""
    scales = fit.estimate.fit.per_part[:, 0].reshape(-1, PARTS)
    return float((scales[:, 0] - scales[:, -1]).mean())


def test_a_fall_of_thrust_is_measured_and_left_to_no_nuisance() -> None:
    none, found, judgement = fitted(True)
    assert judgement.significant
    assert not judgement.at_bound
    assert judgement.sizeable
    assert found.model.values[LOSS] == pytest.approx(HIDDEN[LOSS], rel=0.1)
    assert found.model.values[TIME] == pytest.approx(HIDDEN[TIME], rel=0.3)
    assert fall(none) > 0.01
    assert abs(fall(found)) < 0.002


@pytest.mark.further
def test_what_passes_for_it_where_torques_are_asked_promises_nothing_beside_it() -> None:
    none, found, _ = fitted(True)
    before, beside = (
        {promise.candidate.effect: promise.gain for promise in screen(fit, offered, training(True))}
        for fit, offered in ((fit, candidates_for(fit, training(True))) for fit in (none, found))
    )
    for effect in ("inertia_error", "thrust_scale", "motor_imbalance", "thrust_curve"):
        assert before[effect] > 500.0
        assert beside[effect] < LEAST_GAIN


def test_scales_that_differ_between_flights_are_no_fall() -> None:
    _, found, judgement = fitted(False)
    assert not judgement.sizeable
    assert abs(found.model.values[LOSS]) < 0.003


@pytest.mark.further
def test_that_all_flights_begin_with_more_thrust_is_no_scatter_of_their_parts() -> None:
    none, found, _ = fitted(True)
    assert [shared.name for shared in shared_courses(none)] == ["thrust_scale at first"]
    assert shared_nuisances(none, STOCK)
    assert not shared_courses(found)
    assert not shared_courses(fitted(False)[0])


def with_gains(fit: Fitted, over: Fitted, gains: list[float]) -> Fitted:
    """A fit that gains so much (log-likelihood of forces) over another on each flight."""
    of_parts = np.zeros_like(over.held_out)
    of_parts[0, ::PARTS] = gains
    return dataclasses.replace(
        fit, held_out=over.held_out + of_parts, held_out_in_time=over.held_out_in_time + of_parts
    )


@pytest.mark.parametrize(
    ("gains", "believed"),
    [
        ([-12.0, -12.0, -12.0, 15.0, 15.0, 15.0, 4.0], True),  # 13, which may be chance
        ([-12.0, -12.0, -12.0, 15.0, 15.0, 3.0, 2.0], False),  # -1
    ],
)
def test_a_shared_course_needs_no_second_proof_that_it_is_shared_but_must_predict(
    gains: list[float], believed: bool
) -> None:
    none, found, _ = fitted(True)
    rng, offered = np.random.default_rng(1), with_gains(found, none, gains)
    assert judge(none, offered, (LOSS, TIME), training(True), rng).significant == believed
    alike = dataclasses.replace(
        none.estimate.fit, per_part=np.zeros_like(none.estimate.fit.per_part)
    )  # parts of flights that differ in nothing
    without_course = dataclasses.replace(none, estimate=dataclasses.replace(none.estimate, fit=alike))
    assert not judge(without_course, offered, (LOSS, TIME), training(True), rng).significant


def test_a_shared_course_that_tells_its_own_size_badly_is_known_all_the_same() -> None:
    """Of 13 real flights the loss is 3.5 standard errors from nothing, the course that it explains 4.6."""
    none, found, _ = fitted(True)
    fit, rng = found.estimate.fit, np.random.default_rng(1)
    index = found.variables.index(LOSS)
    error = found.model.change(LOSS) / 3.5
    worse = fit.covariance * (error**2 / fit.covariance[index, index])
    vague = dataclasses.replace(
        found, estimate=dataclasses.replace(found.estimate, fit=dataclasses.replace(fit, covariance=worse))
    )
    assert clustered_errors(vague, training(True))[LOSS] == pytest.approx(error)
    assert judge(none, vague, (LOSS, TIME), training(True), rng).significant
    alike = dataclasses.replace(none.estimate.fit, per_part=np.zeros_like(none.estimate.fit.per_part))
    without_course = dataclasses.replace(none, estimate=dataclasses.replace(none.estimate, fit=alike))
    assert not judge(without_course, vague, (LOSS, TIME), training(True), rng).significant


@pytest.mark.further
def test_flights_kept_back_tell_by_their_nuisances_whether_they_share_what_a_name_explains() -> None:
    """Not by what whitened noise says of three of them, which may be less than nothing."""
    none, found, _ = fitted(True)
    (course,) = shared_courses(none)
    assert shared_by(found, none, [course.name])
    assert not shared_by(none, found, [course.name])
    _, nothing, _ = fitted(False)
    assert abs(next(one.mean for one in every_mean(nothing, STOCK) if one.name == course.name)) < 0.005


def test_a_nuisance_of_no_consequence_refuses_no_name() -> None:
    """Whether it is a little more or less in three flights is chance."""
    none, found, _ = fitted(True)
    (course,) = shared_courses(none)
    least = next(one.least for one in every_mean(found, STOCK) if one.name == course.name)
    assert shared_by(begun(found, 0.8 * least), begun(none, 0.5 * least), [course.name])
    assert not shared_by(begun(found, 1.2 * least), begun(none, 0.5 * least), [course.name])


def begun(fit: Fitted, scale: float) -> Fitted:
    """A fit whose flights all begin with so much more thrust, and differ in nothing else."""
    of_parts = np.zeros_like(fit.estimate.fit.per_part)
    of_parts[::PARTS, 0] = scale
    alike = dataclasses.replace(fit.estimate.fit, per_part=of_parts)
    return dataclasses.replace(fit, estimate=dataclasses.replace(fit.estimate, fit=alike))
