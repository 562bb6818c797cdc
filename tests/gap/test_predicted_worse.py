"""No name is believed with which flights are predicted worse; but luck of few flights kept back is luck."""

from collections.abc import Sequence

import numpy as np
import pytest

from calibration.gap.data.record import FlightRecord
from calibration.gap.estimate.model import Model, Variable
from calibration.gap.replay import PredictionErrors, evaluate
from calibration.gap.report.predicted_worse import FITTED_TOO, predicted_worse
from calibration.gap.search.naming import Named
from calibration.gap.search.retest import FAILED
from onboard.vehicle import load_vehicle
from tests.gap.simulated_flight import circle, fly, with_noise

STOCK = load_vehicle("crazyflie21-stock")
SCALE = Variable("thrust_scale", "scale")


def lifting(*scales: float) -> list[FlightRecord]:
    """A flight each of vehicles that lift so much more than the vehicle file says."""
    flights = []
    for number, scale in enumerate(scales):
        truth = Model(STOCK, {SCALE: scale}).vehicle()
        record = fly(truth, circle(), 6.0, name=f"flight {number}", believed=STOCK)
        flights.append(with_noise(record, 0.5, np.random.default_rng(number)))
    return flights


def named(scale: float) -> Named:
    model = Model(STOCK, {SCALE: scale})
    return Named(("thrust_scale",), (), model, model, {}, {}, (), {})


def stages(names: Named, flights: Sequence[FlightRecord]) -> dict[str, PredictionErrors]:
    return {name: evaluate(flights, model.vehicle()) for name, model in names.models().items()}


@pytest.mark.parametrize(("name", "kept_back", "believed"), [(1.02, 0.99, True), (0.98, 1.02, False)])
def test_what_flights_that_were_fitted_bear_out_is_no_worse(
    name: float, kept_back: float, believed: bool
) -> None:
    """Flights that lift 2 % more: a scale that says so is right, though one was kept back that lifts less."""
    fitted, names = lifting(1.018, 1.02, 1.022), named(name)
    reason = predicted_worse(names, stages(names, lifting(kept_back)), 1.0, fitted)
    assert reason == (None if believed else FITTED_TOO)


def test_beyond_what_flights_have_of_their_own_worse_is_worse() -> None:
    names = named(0.98)
    assert predicted_worse(names, stages(names, lifting(1.02)), 0.01, lifting(0.98)) == FAILED
