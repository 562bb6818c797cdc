"""The constants that the drone's firmware is built with, in one fixed order, and their checksum.

Everything that the onboard computation takes from the vehicle file, and what follows from it. The firmware
reports the checksum of its own as ``perch.vehCrc``; a host that believes in another vehicle does not arm it.

``perch.vehCrc`` is the CRC-32 (zlib) of these 60 float32, little endian, without gaps:

======  ====================================================================================================
place   constant
======  ====================================================================================================
0       mass, kg
1-3     inertia about x, y, z, kg m2
4-5     distance of the motors from the y axis (arm x) and from the x axis (arm y), m
6       form of the thrust map (:class:`onboard.thrust_map.ThrustMapForm`)
7-14    its coefficients, SI, order of :data:`onboard.thrust_map.COEFFICIENT_UNITS`, unused ones 0
15-16   most and least thrust of a motor, N
17-18   time constant of rising and of falling thrust, s
19      drag torque per thrust, m
20-39   gains: fields of :class:`onboard.controller.ControllerGains` in their order, SI, tangent of the tilt
40-59   limits: fields of :class:`onboard.landing.model.LandingLimits` in their order, SI, angles in rad,
        without those that are above (``arm_x``, ``thrust_max``), follow (``weight``) or come with the
        policy (``policy_tau_min``)
======  ====================================================================================================
"""

import zlib
from typing import NamedTuple

import numpy as np

from onboard.controller import controller_gains
from onboard.landing.model import landing_limits
from onboard.vehicle.model import Vehicle

_LIMITS_ELSEWHERE = frozenset({"arm_x", "thrust_max", "weight", "policy_tau_min"})


class OnboardConstant(NamedTuple):
    """One constant: its name, as the C header has it, and its value in SI units."""

    name: str
    value: float


def onboard_constants(vehicle: Vehicle) -> tuple[OnboardConstant, ...]:
    """The constants of a vehicle's firmware, in the order of the table above."""
    body, motors = vehicle.body, vehicle.motors
    thrust_map = motors.thrust_map_compiled()
    gains, limits = controller_gains(vehicle)._asdict(), landing_limits(vehicle)._asdict()
    constants = {
        "mass": body.mass.value,
        "inertia_xx": body.inertia_xx.value,
        "inertia_yy": body.inertia_yy.value,
        "inertia_zz": body.inertia_zz.value,
        "arm_x": body.arm_x.value,
        "arm_y": body.arm_y.value,
        "thrust_map_form": thrust_map.form,
        **{f"thrust_map_{i}": value for i, value in enumerate(thrust_map.coefficients.tolist())},
        "thrust_max": motors.thrust_max.value,
        "thrust_min": motors.thrust_min.value,
        "time_constant_up": motors.time_constant_up.value,
        "time_constant_down": motors.time_constant_down.value,
        "thrust_to_torque": motors.thrust_to_torque.value,
        **{f"gain_{name}": value for name, value in gains.items()},
        **{f"limit_{name}": value for name, value in limits.items() if name not in _LIMITS_ELSEWHERE},
    }
    return tuple(OnboardConstant(name, float(value)) for name, value in constants.items())


def constants_crc32(constants: tuple[OnboardConstant, ...]) -> int:
    """CRC-32 of the constants' values as float32, little endian."""
    return zlib.crc32(np.array([constant.value for constant in constants], dtype="<f4").tobytes())


def vehicle_crc32(vehicle: Vehicle) -> int:
    """What ``perch.vehCrc`` of a firmware that was built for this vehicle reads."""
    return constants_crc32(onboard_constants(vehicle))
