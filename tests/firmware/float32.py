"""The reference on the numbers that the drone has: float32, in the reference's own types."""

from collections.abc import Iterable
from typing import Any, TypeVar

import numpy as np

from onboard.controller import ControllerGains, controller_gains
from onboard.firmware.library import Float32Array
from onboard.landing.model import LandingLimits, landing_limits
from onboard.thrust_map import ThrustMap
from onboard.vehicle import Vehicle, load_vehicle

VEHICLES = tuple(
    load_vehicle(name) for name in ("crazyflie21-upgraded", "crazyflie21-stock", "crazyflie21plus")
)
N = TypeVar("N", bound=tuple[Any, ...])


def rounded(value: float) -> float:
    """The float32 nearest to `value`."""
    return float(np.float32(value))


def rounded_all(numbers: N) -> N:
    """A named tuple of floats with each rounded."""
    return type(numbers)(*(rounded(number) for number in numbers))


def gains32(vehicle: Vehicle) -> ControllerGains:
    return rounded_all(controller_gains(vehicle))


def limits32(vehicle: Vehicle, policy_tau_min: float) -> LandingLimits:
    return rounded_all(landing_limits(vehicle, policy_tau_min))


def thrust_map32(vehicle: Vehicle) -> ThrustMap:
    compiled = vehicle.motors.thrust_map_compiled()
    return ThrustMap(compiled.form, compiled.coefficients.astype(np.float32).astype(np.float64))


def floats(rows: Iterable[Any], width: int) -> Float32Array:
    """Rows of `width` float32."""
    return np.ascontiguousarray(np.array(list(rows), dtype=np.float32).reshape(-1, width))


def address(numbers: Float32Array) -> int:
    """Where the numbers of an array lie, for a function that takes them one after the other."""
    assert numbers.dtype == np.float32
    assert numbers.flags.c_contiguous
    return int(numbers.ctypes.data)
