"""Quadrotors of any size, and their owners' vehicle files: masses right, thrust from a stand, no air."""

import dataclasses
import math
from typing import NamedTuple

import numpy as np

from onboard.quantity import Quantity
from onboard.thrust_map import ThrustMapForm
from onboard.vehicle import Vehicle, load_vehicle

G = 9.81


class Airframe(NamedTuple):
    """A quadrotor, SI units; thrust is ``kf n^2``, its rotors turn at ``fastest`` at duty 1 and full voltage.

    `arm` reaches from the centre to a hub; `lag_up`, `lag_down` are the rotors' time constants; `per_newton`
    is the battery's current per thrust (A/N), `slope` what it loses over its whole `capacity` (V, C).
    """

    mass: float
    arm: float
    ix: float
    iy: float
    iz: float
    kf: float
    fastest: float
    lag_up: float
    lag_down: float
    yaw_lever: float
    full_voltage: float
    slope: float
    capacity: float
    resistance: float
    per_newton: float

    @property
    def highest(self) -> float:
        """Thrust of one rotor at full duty and voltage, N."""
        return self.kf * self.fastest**2


def draw_airframe(rng: np.random.Generator, lightest: float, heaviest: float) -> Airframe:
    """A vehicle between two masses (kg), with levers, inertias, rotors and pack of its size."""
    mass = math.exp(rng.uniform(math.log(lightest), math.log(heaviest)))
    arm = 0.25 * (mass / 2.5) ** (1.0 / 3.0) * rng.uniform(0.8, 1.1)
    inertia = 0.2 * mass * arm**2 * rng.uniform(0.8, 1.2)
    hover = 500.0 * (0.25 / arm) ** 0.78 * rng.uniform(0.8, 1.2)
    small = mass < 0.1  # brushed motors, which coast down
    lag = rng.uniform(0.05, 0.08) if small else rng.uniform(0.025, 0.06)
    cells = 1 if small else 3 if mass < 0.8 else 6
    full = 4.1 * cells
    current = 25.0 / full * mass * G
    return Airframe(
        mass, arm, inertia, inertia * rng.uniform(0.95, 1.25), inertia * rng.uniform(1.6, 1.95),
        mass * G / 4.0 / hover**2, hover * math.sqrt(rng.uniform(2.3, 3.2)),
        lag, lag * (rng.uniform(1.2, 2.0) if small else 1.0), 0.0074 * (arm / 0.046) ** 0.53,
        full, 0.15 * full, 450.0 * current, 0.08 * full / current, 25.0 / full,
    )  # fmt: skip


def nominal(frame: Airframe, name: str) -> Vehicle:
    """The vehicle file that its owner would have."""
    base = load_vehicle("crazyflie21-stock")

    def q(value: float, unit: str) -> Quantity:
        return Quantity(float(value), unit, 0.0, "truth program")

    lever = frame.arm / math.sqrt(2.0)
    body = dataclasses.replace(
        base.body,
        mass=q(frame.mass, "kg"),
        inertia_xx=q(frame.ix, "kg m2"), inertia_yy=q(frame.iy, "kg m2"), inertia_zz=q(frame.iz, "kg m2"),
        arm_x=q(lever, "m"), arm_y=q(lever, "m"),
        body_half_x=q(lever, "m"), body_half_y=q(lever, "m"),
        body_top_z=q(0.4 * frame.arm, "m"), body_bottom_z=q(-0.4 * frame.arm, "m"),
        propeller_radius=q(0.45 * frame.arm, "m"), propeller_height_z=q(0.0, "m"),
    )  # fmt: skip
    cubic = {"c0": 0.0, "c1": 0.0, "c2": frame.highest / frame.full_voltage**2, "c3": 0.0}
    units = {"c0": "N", "c1": "N/V", "c2": "N/V2", "c3": "N/V3"}
    thrust_map = dataclasses.replace(
        base.motors.thrust_map,
        form=ThrustMapForm.FIRMWARE_CUBIC,
        coefficients={key: q(value, units[key]) for key, value in cubic.items()},
        name=None,
    )
    motors = dataclasses.replace(
        base.motors, thrust_map=thrust_map,
        thrust_max=q(frame.highest, "N"), thrust_min=q(0.01 * frame.highest, "N"),
        time_constant_up=q(frame.lag_up, "s"), time_constant_down=q(frame.lag_down, "s"),
        thrust_to_torque=q(frame.yaw_lever, "m"), thrust_coefficient=q(frame.kf, "N s2/rad2"),
    )  # fmt: skip
    battery = dataclasses.replace(
        base.battery, open_circuit_full=q(frame.full_voltage, "V"), open_circuit_slope=q(frame.slope, "V"),
        capacity=q(frame.capacity, "C"), resistance=q(frame.resistance, "ohm"),
        motor_current_per_newton=q(frame.per_newton, "A/N"), cutoff=q(0.75 * frame.full_voltage, "V"),
    )  # fmt: skip
    return dataclasses.replace(
        base, name=name, description=f"quadrotor of {name}", body=body, motors=motors, battery=battery
    )
