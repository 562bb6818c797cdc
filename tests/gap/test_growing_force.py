"""A force that grows within every flight is no wind, and no scatter of the parts of flights."""

import dataclasses
from collections.abc import Sequence

import numpy as np
import pytest

from calibration.gap.data.record import FlightRecord
from calibration.gap.estimate.model import Model, Variable
from calibration.gap.estimate.refine import Training, refine, training_set
from calibration.gap.estimate.shared_nuisances import shared_nuisances
from onboard.vehicle import load_vehicle
from tests.gap.simulated_flight import circle, fly, up_and_down, with_noise

STOCK = load_vehicle("crazyflie21-stock")
WIND = (Variable("wind", "x"), Variable("wind", "y"))
SECONDS = 24.0


def pushed(record: FlightRecord, growth: float) -> FlightRecord:
    """The flight with a push along b_y that grows from nothing to `growth` (m/s2)."""
    force = record.specific_force.copy()
    force[:, 1] += growth * (record.t - record.t[0]) / SECONDS
    return dataclasses.replace(record, specific_force=force)


def training(growths: Sequence[float]) -> Training:
    rng = np.random.default_rng(5)
    paths = (circle(), up_and_down(), circle(period=3.0), up_and_down(period=2.0), circle(radius=0.4))
    flown = (
        fly(STOCK, path, SECONDS, shape=f"shape {n}", name=f"flight {n}") for n, path in enumerate(paths)
    )
    noisy = [with_noise(record, 0.5, rng) for record in flown]
    return training_set(
        [pushed(one, growth) for one, growth in zip(noisy, growths, strict=True)], Model(STOCK)
    )


@pytest.mark.parametrize("variables", [(), WIND])
def test_that_it_grows_in_all_flights_is_told_also_beside_a_wind(variables: tuple[Variable, ...]) -> None:
    fit = refine(Model(STOCK), variables, training([0.4] * 5))
    (course,) = [one for one in shared_nuisances(fit, STOCK) if one.name.endswith("at first")]
    assert course.name == "force_bias_y at first"
    # The first quarter lies at an eighth of the growth, the others at five eighths.
    assert course.mean == pytest.approx(-0.5 * 0.4, abs=0.02)


def test_what_grows_in_one_flight_and_falls_in_another_is_its_own() -> None:
    fit = refine(Model(STOCK), (), training([0.4, -0.4, 0.3, -0.3, 0.1]))
    assert not shared_nuisances(fit, STOCK)
