"""How high the body's origin of a drone is that stands on its feet, by its vehicle file.

    h = -(hip_z - L cos psi) + r_foot - sag,   sag = F L^2 sin^2 psi / k + F cos^2 psi / k_axial,  F = m g / 4

k: torsional stiffness of the hinges (scaled by the effect ``leg_stiffness``), k_axial: along the leg. A drone
without legs stands on its hull.
"""

import math

from onboard.gravity import GRAVITY
from onboard.vehicle import Legs, Vehicle

HEIGHT_SIGMA = 1.5e-3
"""m, standard uncertainty of a height by the vehicle file: legs are glued by hand."""


def standing_height(vehicle: Vehicle) -> float:
    """m, of the body's origin above the surface that it stands on."""
    hull = -vehicle.body.body_bottom_z.value
    if vehicle.legs is None:
        return hull
    return max(hull, _on_legs(vehicle, vehicle.legs))


def _on_legs(vehicle: Vehicle, legs: Legs) -> float:
    length, psi = legs.length.value, legs.angle
    share = 0.25 * vehicle.body.mass.value * GRAVITY
    effect = next((one for one in vehicle.effects if one.name == "leg_stiffness"), None)
    stiffness = legs.stiffness.value * (1.0 if effect is None else effect.values()["scale"])
    sag = share * (length * math.sin(psi)) ** 2 / stiffness
    sag += share * math.cos(psi) ** 2 / legs.axial_stiffness.value
    return length * math.cos(psi) - legs.hip_z.value + legs.foot_radius.value - sag
