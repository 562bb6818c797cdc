"""What is left with all names in the model: errors, places and means that keep a verdict from being given."""

import dataclasses

import numpy as np
import pytest

from calibration.gap.estimate.mixed import FIRST_SPREAD, MixedFit, Products
from calibration.gap.estimate.model import Model
from calibration.gap.estimate.nuisances import NUISANCES
from calibration.gap.estimate.refine import Fitted
from calibration.gap.estimate.regression import LinearisedFit, Noise
from calibration.gap.estimate.unstated import prior_of_unstated
from calibration.gap.report.document import Gap, Levels
from calibration.gap.report.remaining import own_floor, remaining
from calibration.gap.unnamed.gap_map import GapMap
from onboard.vehicle import load_vehicle
from tests.truth.airframe import draw_airframe, nominal

VEHICLE = load_vehicle("crazyflie21-stock")
NONE = np.zeros((0, 0))
PARTS, FLIGHTS = 4, 6
NO_MAP = GapMap((), (), NONE, NONE, NONE, ())


def gap(before: float, after: float) -> Gap:
    levels = Levels(before=before, after=after, noise_floor=0.02, unit="m")
    return Gap(metric="position error", overall=levels)


def fitted(per_part: np.ndarray) -> Fitted:
    """A fit of which only the nuisances are looked at."""
    nothing = np.zeros((per_part.shape[0], 0))
    square = np.zeros((per_part.shape[0], 0, 0))
    mixed = MixedFit(np.zeros(0), NONE, FIRST_SPREAD, per_part, square, nothing)
    zeros = np.zeros(per_part.shape[0])
    q = len(NUISANCES)
    products = Products(
        np.zeros((zeros.size, q, q)), np.zeros((zeros.size, q, 0)), square,
        np.zeros((zeros.size, q)), nothing, zeros, zeros,
    )  # fmt: skip
    noise = Noise(np.zeros((7, 16)), np.ones(7))
    estimate = LinearisedFit(mixed, products, (products,) * 3, noise, np.zeros((0, 7)))
    likelihoods = (np.zeros((3, zeros.size)),) * 2
    return Fitted(
        Model(VEHICLE),
        (),
        estimate,
        *likelihoods,
        zeros.astype(int),
        np.zeros((0, 7)),
        (),
        unstated=prior_of_unstated(0),
    )


def left(levels: Gap, per_part: np.ndarray, named: bool) -> tuple[str, ...]:
    return remaining(levels, 0.0, fitted(per_part), NO_MAP, VEHICLE, named)


def own(scale: float, kept_back: int) -> float:
    """Floor of flights whose scales of thrust scatter by so much, and nothing else."""
    one = fitted(quiet())
    spread = np.where(np.arange(FIRST_SPREAD.size) == len(NUISANCES), scale, 0.0)
    mixed = dataclasses.replace(one.estimate.fit, spread=spread)
    return own_floor(
        dataclasses.replace(one, estimate=dataclasses.replace(one.estimate, fit=mixed)), kept_back
    )


def quiet() -> np.ndarray:
    rng = np.random.default_rng(1)
    return 0.01 * rng.standard_normal((PARTS * FLIGHTS, len(NUISANCES)))


def test_errors_below_twice_the_floor_leave_nothing() -> None:
    assert left(gap(0.039, 0.039), quiet(), False) == ()


def test_a_single_flight_that_lifts_less_than_the_others_is_no_gap() -> None:
    error = 0.5 * 9.81 * 3.0 * 0.005  # of three standard deviations, after 1 s
    assert own(0.005, 1) == pytest.approx(0.5 * error)
    assert remaining(gap(error, error), own(0.005, 1), fitted(quiet()), NO_MAP, VEHICLE, False) == ()
    assert own(0.005, 4) == own(0.005, 9) == pytest.approx(error / 3.0)  # of many it would be one


def test_scatter_beyond_what_is_ordinary_is_a_gap() -> None:
    ordinary = FIRST_SPREAD[len(NUISANCES)]
    assert own(5.0 * ordinary, 4) == own(ordinary, 4) == pytest.approx(0.5 * 9.81 * ordinary)


def test_an_error_without_a_name_is_left() -> None:
    (sentence,) = left(gap(0.7, 0.7), quiet(), False)
    assert "0.7 m" in sentence


def test_a_name_must_close_half_of_what_lies_above_the_floor() -> None:
    assert left(gap(1.0, 0.3), quiet(), True) == ()
    (sentence,) = left(gap(1.58, 1.49), quiet(), True)
    assert "6%" in sentence


def test_a_force_that_all_flights_share_is_no_nuisance() -> None:
    shared = quiet()
    shared[:, 1] += 3.0
    (sentence,) = left(gap(0.03, 0.03), shared, False)
    assert sentence.startswith("force bias x: 3")


def test_a_small_or_scattered_mean_is_one() -> None:
    small, scattered = quiet(), quiet()
    small[:, 3] += 0.5
    scattered[:, 3] += np.repeat([9.0, -9.0, 9.0, -9.0, 9.0, 2.0], PARTS)
    assert left(gap(0.03, 0.03), small, False) == ()
    assert left(gap(0.03, 0.03), scattered, False) == ()


def test_a_torque_larger_than_any_flight_has_of_its_own_is_a_gap_though_it_scatters() -> None:
    """A vehicle 4 mm out of balance tipped over eight times, and in each flight otherwise."""
    tipping = quiet()
    tipping[:, 3] += np.repeat([-7.0, -24.0, -23.0, -43.0, -14.0, 30.0], PARTS)
    (sentence,) = left(gap(0.03, 0.03), tipping, False)
    assert sentence.startswith("torque trim x: 26.1 rad/s2")


def test_a_yaw_that_every_vehicle_of_kilograms_has_is_its_own() -> None:
    """0.2 rad/s2 of a rotor that leans, on a healthy one of 3.4 kg."""
    heavy = nominal(draw_airframe(np.random.default_rng(1), 3.4, 3.5), "heavy")
    yawing = quiet()
    yawing[:, 5] = np.repeat([-0.2, 0.3, 0.1, -0.3, 0.2, 0.1], PARTS)
    assert remaining(gap(0.03, 0.03), 0.0, fitted(yawing), NO_MAP, heavy, False) == ()
