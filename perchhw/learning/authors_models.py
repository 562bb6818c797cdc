"""The vehicles of the authors' simulation, one for each leg design, as far as they differ from ours.

SIM@6a3be0be:crazyflie_gazebo/models/Crazyflie_Models: the body is one link, to which domain randomisation
gives the mass and inertia of the whole vehicle; the legs are links of their own on top of it. Body contact is
that of a box of 120 x 120 x 10 mm; propellers do not collide. Table I prints 5 and 60 deg where the models
have 0 and 50 (paper errata 4).
"""

import dataclasses
import math
from typing import NamedTuple

import numpy as np

from onboard.quantity import Quantity
from onboard.vehicle import Body, Legs, Vehicle, load_vehicle
from perchhw.learning.errors import LearningInputError

SOURCE = "authors' simulation, SIM@6a3be0be"

LEG_ANGLES_DEG = {"narrow": 0.0, "semi-narrow": 30.0, "wide": 50.0}

BOX_HALF, BOX_BOTTOM, BOX_TOP = 0.060, 0.005, 0.015
"""m, box whose contact counts, above the origin of the body link."""

SENSORS_MASS = 1.4e-4
"""kg, of the links of sensors and rotors, at the body link's origin."""


class LegMass(NamedTuple):
    """Mass (kg) of a leg's rod and of the pad at its end."""

    rod: float
    pad: float


LEG_MASSES = {"semi-narrow-long": LegMass(0.74e-3, 0.159e-3)}
LONG, SHORT = LegMass(0.66e-3, 0.01e-3), LegMass(0.44e-3, 0.01e-3)
"""The flown design has heavier legs; all other long ones and all short ones are alike."""

AUTHORS_STIFFNESS, AUTHORS_DAMPING = 0.08, 6.788e-5
"""N m/rad and N m s/rad of every hinge (paper errata 4)."""


def authors_vehicle(
    name: str, design: str, stiffness: float = AUTHORS_STIFFNESS, damping: float = AUTHORS_DAMPING
) -> Vehicle:
    """A vehicle as the authors' simulation has it with a leg design.

    Args:
        name: of our vehicle, or its file: mass and inertia of the authors' body link, motors and the rest.
        design: one of Table I.
        stiffness: N m/rad of the hinge. damping: N m s/rad.

    Raises:
        VehicleFileError: vehicle or design cannot be used.
        LearningInputError: the vehicle has no legs.
    """
    vehicle = load_vehicle(name, design)
    if vehicle.legs is None:
        raise LearningInputError(f"vehicle {name!r} has no legs to land on: name a design")
    family, _, length = design.rpartition("-")
    legs = dataclasses.replace(
        vehicle.legs,
        angle_deg=_exact(LEG_ANGLES_DEG[family], "deg"),
        stiffness=_exact(stiffness, "N m/rad"),
        damping=_exact(damping, "N m s/rad"),
        deflection_limit=_exact(math.radians(170.0), "rad"),  # no stop
    )
    mass = LEG_MASSES.get(design, LONG if length == "long" else SHORT)
    body, drop = _with_legs(vehicle.body, legs, mass)
    hip_z = _exact(legs.hip_z.value + drop, "m")
    return dataclasses.replace(vehicle, body=body, legs=dataclasses.replace(legs, hip_z=hip_z))


def _exact(value: float, unit: str) -> Quantity:
    return Quantity(value, unit, 0.0, SOURCE)


def _with_legs(body: Body, legs: Legs, mass: LegMass) -> tuple[Body, float]:
    """The body with its legs' mass and the authors' box, and how far its centre of mass is lowered (m)."""
    places, masses, own = _leg_parts(legs, mass)
    bare = body.mass.value + SENSORS_MASS
    total = bare + float(masses.sum())
    drop = -float(masses @ places[:, 2]) / total
    inertia = np.array([body.inertia_xx.value, body.inertia_yy.value, body.inertia_zz.value])
    inertia += bare * np.array([drop**2, drop**2, 0.0]) + own
    x, y, z = places[:, 0], places[:, 1], places[:, 2] + drop
    inertia += np.array([masses @ (y**2 + z**2), masses @ (x**2 + z**2), masses @ (x**2 + y**2)])
    return dataclasses.replace(
        body,
        mass=_exact(total, "kg"),
        inertia_xx=_exact(float(inertia[0]), "kg m2"),
        inertia_yy=_exact(float(inertia[1]), "kg m2"),
        inertia_zz=_exact(float(inertia[2]), "kg m2"),
        body_half_x=_exact(BOX_HALF, "m"),
        body_half_y=_exact(BOX_HALF, "m"),
        body_top_z=_exact(BOX_TOP + drop, "m"),
        body_bottom_z=_exact(BOX_BOTTOM + drop, "m"),
        propeller_radius=_exact(1e-3, "m"),  # within the box: a propeller is not there
        propeller_height_z=_exact(0.5 * (BOX_TOP + BOX_BOTTOM) + drop, "m"),
    ), drop


def _leg_parts(legs: Legs, mass: LegMass) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Centres (8, 3) (m) and masses (8,) (kg) of rods and pads; the rods' own inertia (3,) (kg m2)."""
    signs = np.array([[1.0, -1.0], [-1.0, -1.0], [-1.0, 1.0], [1.0, 1.0]])
    length = legs.length.value
    outwards = math.sin(legs.angle) / math.sqrt(2.0)
    direction = np.column_stack([signs * outwards, np.full(4, -math.cos(legs.angle))])
    hips = np.column_stack([signs * [legs.hip_x.value, legs.hip_y.value], np.full(4, legs.hip_z.value)])
    places = np.vstack([hips + 0.5 * length * direction, hips + length * direction])
    masses = np.repeat([mass.rod, mass.pad], 4)
    own = mass.rod * length**2 / 12.0 * np.sum(1.0 - direction**2, axis=0)
    return places, masses, own
