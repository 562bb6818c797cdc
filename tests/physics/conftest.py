"""Parameters of the paper's flying vehicle, and small helpers."""

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from onboard.room import RoomGeometry
from onboard.vehicle import load_vehicle
from sim_backend.physics.parameters import physics_parameters


@pytest.fixture
def parameters() -> Any:
    """crazyflie21-upgraded under a ceiling at 2.10 m; a fresh record that a test may change."""
    return physics_parameters(load_vehicle("crazyflie21-upgraded-stored"), RoomGeometry())


@pytest.fixture
def open_sky(parameters: Any) -> Any:
    """The same vehicle with neither ceiling nor floor within reach of a test."""
    parameters["ceiling_z"] = 1e6
    return parameters


@pytest.fixture
def rng() -> np.random.Generator:
    return np.random.default_rng(20221026)


@pytest.fixture
def high() -> NDArray[np.float64]:
    """A place far from ceiling and floor of `open_sky`."""
    return np.array([0.0, 0.0, 1000.0])
