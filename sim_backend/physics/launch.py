"""How real approaches and flips differ from what they are told: speed that is reached, ceiling, moment."""

import math
from typing import Any, NamedTuple

from onboard.arrays import Vector
from onboard.mixer import Thrusts
from sim_backend.physics.jit import inner


class Launch(NamedTuple):
    """What differs from attempt to attempt; nothing by default, and then nothing is drawn.

    Attributes:
        reached_x, reached_z: share of the commanded velocity that an approach reaches.
        spread_x, spread_y, spread_z: m/s, standard deviations of the velocity about that.
        ceiling: m, by how much the ceiling is higher than the drone reckons. ceiling_spread: m, its
            standard deviation.
        flip_spread: standard deviation of the flip's moment, as a share.
        flip_roll: standard deviation of the roll acceleration per pitch acceleration in the flip.
    """

    reached_x: float = 1.0
    reached_z: float = 1.0
    spread_x: float = 0.0
    spread_y: float = 0.0
    spread_z: float = 0.0
    ceiling: float = 0.0
    ceiling_spread: float = 0.0
    flip_spread: float = 0.0
    flip_roll: float = 0.0


EXACT = Launch()


@inner
def launch_velocity(rng: Any, speed: float, angle: float, launch: Launch) -> Vector:
    """Velocity (m/s, world) of an approach that is told `speed` (m/s) at `angle` (rad above the horizon)."""
    x = launch.reached_x * speed * math.cos(angle)
    z = launch.reached_z * speed * math.sin(angle)
    if launch.spread_x <= 0.0 and launch.spread_y <= 0.0 and launch.spread_z <= 0.0:
        return x, 0.0, z
    x += launch.spread_x * rng.standard_normal()
    y = launch.spread_y * rng.standard_normal()
    return x, y, z + launch.spread_z * rng.standard_normal()


@inner
def ceiling_error(rng: Any, launch: Launch) -> float:
    """By how much (m) the drone reckons the ceiling too low in this attempt."""
    if launch.ceiling_spread <= 0.0:
        return launch.ceiling
    return launch.ceiling + launch.ceiling_spread * rng.standard_normal()


@inner
def flip_gains(rng: Any, p: Any, launch: Launch) -> tuple[float, float]:
    """Factors of the right and the left motors' thrust in this flip."""
    if launch.flip_spread <= 0.0 and launch.flip_roll <= 0.0:
        return 1.0, 1.0
    gain = 1.0 + launch.flip_spread * rng.standard_normal()
    per_side = p.inertia[0] * p.arm_x / (p.inertia[1] * p.arm_y)
    side = per_side * launch.flip_roll * rng.standard_normal()
    return gain * (1.0 + side), gain * (1.0 - side)


@inner
def scattered_flip(targets: Thrusts, gains: tuple[float, float]) -> Thrusts:
    """Thrusts (N) of M1 to M4 with the factors of :func:`flip_gains`."""
    right, left = gains
    return right * targets[0], right * targets[1], left * targets[2], left * targets[3]
