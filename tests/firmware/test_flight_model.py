"""The model of the vehicle in C, held to the reference step by step."""

import numpy as np
import pytest

from onboard.firmware.library import CoreLibrary, Float32Array, vehicle_constants
from onboard.flight_model import SIZE, THRUST, FlightModel, flight_model, fly_model
from onboard.vehicle import Vehicle
from tests.firmware.float32 import VEHICLES, address, floats, rounded, rounded_all
from tests.firmware.test_law_parity import random_states

DT = 1e-3
BOUND = 1e-6
"""m, m/s, 1, rad/s, N: of a step, of numbers up to 1, and the same share of greater ones."""


def random_models(seed: int, count: int) -> Float32Array:
    """States (17) with the thrusts asked for (4): any attitude, 30 rad/s, beyond both limits of a motor."""
    rng = np.random.default_rng(seed)
    estimates = random_states(seed, count)[0]
    return floats(
        np.hstack([estimates, rng.uniform(0.0, 0.15, (count, 4)), rng.uniform(-0.05, 0.25, (count, 4))]), 21
    )


def in_c(core: CoreLibrary, vehicle: Vehicle, models: Float32Array, dt: float) -> Float32Array:
    models = models.copy()
    core.perch_host_model(vehicle_constants(vehicle), len(models), address(models), dt)
    return models[:, :SIZE]


def in_python(model: FlightModel, models: Float32Array, dt: float) -> np.ndarray:
    states = models[:, :SIZE].astype(np.float64)
    for state, asked in zip(states, models[:, SIZE:].astype(np.float64).tolist(), strict=True):
        m1, m2, m3, m4 = asked
        fly_model(state, (m1, m2, m3, m4), model, dt)
    return states


def check(core: CoreLibrary, vehicle: Vehicle, models: Float32Array) -> None:
    found = in_c(core, vehicle, models, DT)
    wanted = in_python(rounded_all(flight_model(vehicle)), models, rounded(DT))
    assert np.array_equal(np.isfinite(found), np.isfinite(wanted))
    share = np.abs(found - wanted) / np.maximum(1.0, np.abs(wanted))
    assert np.nanmax(share) <= BOUND


@pytest.mark.parametrize("vehicle", VEHICLES, ids=lambda vehicle: vehicle.name)
def test_a_step(core: CoreLibrary, vehicle: Vehicle) -> None:
    check(core, vehicle, random_models(1, 2000))


@pytest.mark.soak
def test_a_step_from_a_million_states(core: CoreLibrary) -> None:
    for part in range(10):
        check(core, VEHICLES[0], random_models(100 + part, 100_000))


def test_a_step_at_the_edges(core: CoreLibrary) -> None:
    """NaN in each number alone, motors at rest, at their limits, and asked for what is no number."""
    vehicle, limits = VEHICLES[0], flight_model(VEHICLES[0])
    good = random_models(2, 1)[0]
    cases = []
    for i in range(21):
        for value in (np.nan, 0.0, limits.thrust_min, limits.thrust_max):
            case = good.copy()
            case[i] = value
            cases.append(case)
    for i in range(SIZE, 21):
        for value in (np.inf, -np.inf):
            case = good.copy()
            case[i] = value
            cases.append(case)
    models = floats(cases, 21)
    check(core, vehicle, models)
    asked_for_nothing = models[np.isnan(models[:, SIZE:]).any(axis=1)]
    assert np.isfinite(in_c(core, vehicle, asked_for_nothing, DT)).all()


def test_a_second_of_hover_stays_within_a_micrometre(core: CoreLibrary) -> None:
    """Float32 steps of 1 ms lose nothing of a hover's balance."""
    vehicle, model = VEHICLES[0], flight_model(VEHICLES[0])
    models = np.zeros((1, 21), np.float32)
    models[0, 2], models[0, 9] = 0.5, 1.0
    models[0, THRUST:] = 0.25 * model.mass * 9.81
    for _ in range(1000):
        models[:, :SIZE] = in_c(core, vehicle, models, DT)
    assert np.abs(models[0, :3] - (0.0, 0.0, 0.5)).max() < 1e-6
