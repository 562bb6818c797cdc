"""What is known of one drone, as frozen dataclasses: each number with unit, uncertainty and source.

All quantities are in SI units (leg angles in degrees, as their name says). Frames: body FLU with its origin
in the centre of mass, motors M1 front right, M2 back right, M3 back left, M4 front left.
"""

import math
from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Annotated

import numpy as np

from onboard.gravity import GRAVITY
from onboard.quantity import Quantity
from onboard.thrust_map import COEFFICIENT_UNITS, ThrustMap, ThrustMapForm
from onboard.vehicle.effects import EFFECTS, Size
from onboard.vehicle.effects.size import REFERENCE
from onboard.vehicle.schema import Measured, Range
from onboard.vehicle.unnamed import UnnamedCurve

SCHEMA = "perchhw.vehicle/1"

EFFECT_NAMES = tuple(EFFECTS)
"""Names that an ``[[effects]]`` table may have."""


@dataclass(frozen=True, kw_only=True)
class Body:
    """Rigid body and its hull.

    Attributes:
        mass: kg, ready to fly (battery and legs included).
        inertia_xx, inertia_yy, inertia_zz: kg m2 about the body axes.
        arm_x, arm_y: m, distance of the motors from the body's y and x axis.
        body_half_x, body_half_y: m, half size of the hull box that may touch a surface.
        body_top_z, body_bottom_z: m, upper and lower face of the hull box (body z).
        propeller_radius: m.
        propeller_height_z: m, plane of the propellers (body z).
    """

    mass: Annotated[Quantity, Measured("kg", Range.POSITIVE)]
    inertia_xx: Annotated[Quantity, Measured("kg m2", Range.POSITIVE)]
    inertia_yy: Annotated[Quantity, Measured("kg m2", Range.POSITIVE)]
    inertia_zz: Annotated[Quantity, Measured("kg m2", Range.POSITIVE)]
    arm_x: Annotated[Quantity, Measured("m", Range.POSITIVE)]
    arm_y: Annotated[Quantity, Measured("m", Range.POSITIVE)]
    body_half_x: Annotated[Quantity, Measured("m", Range.POSITIVE)]
    body_half_y: Annotated[Quantity, Measured("m", Range.POSITIVE)]
    body_top_z: Annotated[Quantity, Measured("m", Range.ANY)]
    body_bottom_z: Annotated[Quantity, Measured("m", Range.ANY)]
    propeller_radius: Annotated[Quantity, Measured("m", Range.POSITIVE)]
    propeller_height_z: Annotated[Quantity, Measured("m", Range.ANY)]


@dataclass(frozen=True, kw_only=True)
class ThrustMapDescription:
    """A thrust map as a vehicle file holds it: form, coefficients with provenance, optional library name."""

    form: ThrustMapForm
    coefficients: dict[str, Quantity]
    name: str | None = None

    def compiled(self) -> ThrustMap:
        """The map for compiled code."""
        values = np.zeros(8)
        for index, key in enumerate(COEFFICIENT_UNITS[self.form]):
            values[index] = self.coefficients[key].value
        return ThrustMap(int(self.form), values)


@dataclass(frozen=True, kw_only=True)
class Motors:
    """The four motors with propellers.

    Attributes:
        thrust_map: motor voltage to thrust.
        thrust_max, thrust_min: N per motor; a command below `thrust_min` stops the motor.
        time_constant_up, time_constant_down: s, first order in thrust (errata, section 2).
        thrust_to_torque: m, drag torque per thrust.
        pwm_bits: resolution of the motor PWM.
        rotor_inertia: kg m2 of one rotor with propeller about its axis, if known.
        thrust_coefficient: N s2/rad2, thrust over the square of the rotor speed, if known.
    """

    thrust_map: ThrustMapDescription
    thrust_max: Annotated[Quantity, Measured("N", Range.POSITIVE)]
    thrust_min: Annotated[Quantity, Measured("N", Range.NON_NEGATIVE)]
    time_constant_up: Annotated[Quantity, Measured("s", Range.POSITIVE)]
    time_constant_down: Annotated[Quantity, Measured("s", Range.POSITIVE)]
    thrust_to_torque: Annotated[Quantity, Measured("m", Range.POSITIVE)]
    pwm_bits: Annotated[Quantity, Measured("bit", Range.PWM_BITS)]
    rotor_inertia: Annotated[Quantity | None, Measured("kg m2", Range.POSITIVE)] = None
    thrust_coefficient: Annotated[Quantity | None, Measured("N s2/rad2", Range.POSITIVE)] = None

    def thrust_map_compiled(self) -> ThrustMap:
        """The thrust map for compiled code."""
        return self.thrust_map.compiled()


@dataclass(frozen=True, kw_only=True)
class Battery:
    """Battery as a source behind a resistance.

    Open circuit: ``E = open_circuit_full - open_circuit_slope * charge_used / capacity``; terminal:
    ``V = E - resistance * I`` with the first model ``I = motor_current_per_newton * sum(F)``, the current
    out of the battery (Bitcraze's 2015 table fits a constant 6.9 A/N within 8 % from 0.14 N to full thrust).

    Attributes:
        open_circuit_full: V, of a charged pack at rest.
        open_circuit_slope: V, fall of the open circuit over the whole capacity.
        capacity: C (files may say mAh).
        resistance: ohm, cell, leads and board together.
        motor_current_per_newton: A/N.
        cutoff: V at the terminals below which the pack counts as empty.
    """

    open_circuit_full: Annotated[Quantity, Measured("V", Range.POSITIVE)]
    open_circuit_slope: Annotated[Quantity, Measured("V", Range.NON_NEGATIVE)]
    capacity: Annotated[Quantity, Measured("C", Range.POSITIVE)]
    resistance: Annotated[Quantity, Measured("ohm", Range.NON_NEGATIVE)]
    motor_current_per_newton: Annotated[Quantity, Measured("A/N", Range.NON_NEGATIVE)]
    cutoff: Annotated[Quantity, Measured("V", Range.POSITIVE)]


@dataclass(frozen=True, kw_only=True)
class Legs:
    """Four equal sprung legs with adhesive feet.

    The hips are at (+-hip_x, +-hip_y, hip_z) in the body frame; a leg leans outwards along the diagonal of
    its quadrant by `angle_deg` from -b_z. The hinge is a torsional spring and damper for any bending.

    Attributes:
        design: name of the design.
        angle_deg: deg (psi of Table I).
        length: m, hip to foot.
        hip_x, hip_y, hip_z: m.
        foot_radius: m.
        stiffness: N m/rad of the hinge.
        damping: N m s/rad of the hinge.
        deflection_limit: rad at which the hinge meets its stop.
        axial_stiffness: N/m along the leg, compliance of leg, foot and surface together.
        axial_damping: N s/m along the leg.
        minimum_preload: N, push that a foot needs to attach.
        adhesion_strength: N, pull at which a foot comes off; absent: it never does.
        hinge_inertia: kg m2 of leg and foot about the hip, if known.
    """

    design: str
    angle_deg: Annotated[Quantity, Measured("deg", Range.NON_NEGATIVE)]
    length: Annotated[Quantity, Measured("m", Range.POSITIVE)]
    hip_x: Annotated[Quantity, Measured("m", Range.NON_NEGATIVE)]
    hip_y: Annotated[Quantity, Measured("m", Range.NON_NEGATIVE)]
    hip_z: Annotated[Quantity, Measured("m", Range.ANY)]
    foot_radius: Annotated[Quantity, Measured("m", Range.NON_NEGATIVE)]
    stiffness: Annotated[Quantity, Measured("N m/rad", Range.POSITIVE)]
    damping: Annotated[Quantity, Measured("N m s/rad", Range.NON_NEGATIVE)]
    deflection_limit: Annotated[Quantity, Measured("rad", Range.POSITIVE)]
    axial_stiffness: Annotated[Quantity, Measured("N/m", Range.POSITIVE)]
    axial_damping: Annotated[Quantity, Measured("N s/m", Range.NON_NEGATIVE)]
    minimum_preload: Annotated[Quantity, Measured("N", Range.NON_NEGATIVE)]
    adhesion_strength: Annotated[Quantity | None, Measured("N", Range.NON_NEGATIVE)] = None
    hinge_inertia: Annotated[Quantity | None, Measured("kg m2", Range.POSITIVE)] = None

    @property
    def angle(self) -> float:
        """Leg angle psi in rad."""
        return math.radians(self.angle_deg.value)

    @property
    def adhesion_limit(self) -> float:
        """Pull (N) at which a foot comes off; `inf` when the adhesion is perfect."""
        return math.inf if self.adhesion_strength is None else self.adhesion_strength.value


@dataclass(frozen=True, kw_only=True)
class Air:
    """Linear drag of the body, force = -drag * velocity along each body axis (N s/m)."""

    drag_x: Annotated[Quantity, Measured("N s/m", Range.NON_NEGATIVE)]
    drag_y: Annotated[Quantity, Measured("N s/m", Range.NON_NEGATIVE)]
    drag_z: Annotated[Quantity, Measured("N s/m", Range.NON_NEGATIVE)]


@dataclass(frozen=True, kw_only=True)
class Sensing:
    """Inertial sensors: white noise (standard deviation of one 1 kHz sample) and ranges (+-).

    Attributes:
        accelerometer_noise, accelerometer_range: m/s2.
        gyro_noise, gyro_range: rad/s.
        battery_voltage_noise: V of one reading of the battery voltage.
    """

    accelerometer_noise: Annotated[Quantity, Measured("m/s2", Range.NON_NEGATIVE)]
    accelerometer_range: Annotated[Quantity, Measured("m/s2", Range.POSITIVE)]
    gyro_noise: Annotated[Quantity, Measured("rad/s", Range.NON_NEGATIVE)]
    gyro_range: Annotated[Quantity, Measured("rad/s", Range.POSITIVE)]
    battery_voltage_noise: Annotated[Quantity, Measured("V", Range.NON_NEGATIVE)]


@dataclass(frozen=True, kw_only=True)
class Effect:
    """A named effect beyond the base model, with its parameters (:data:`onboard.vehicle.effects.EFFECTS`)."""

    name: str
    parameters: dict[str, Quantity]

    def values(self) -> dict[str, float]:
        """Every parameter's value in SI units, those that the file leaves out at their neutral value."""
        return EFFECTS[self.name].values(self.parameters)


@dataclass(frozen=True, kw_only=True)
class Vehicle:
    """One vehicle. `legs` is None for a bare drone; `effects` are the effects that this vehicle has,
    `unnamed` what flights showed besides, without a name."""

    name: str
    description: str
    body: Body
    motors: Motors
    battery: Battery
    legs: Legs | None
    air: Air
    sensing: Sensing
    effects: tuple[Effect, ...] = ()
    unnamed: tuple[UnnamedCurve, ...] = ()

    @property
    def size(self) -> Size:
        """Magnitudes from which the sizes of effects follow."""
        return size_of(self.body, self.motors, self.battery)

    def with_effects(self, effects: Iterable[Effect]) -> "Vehicle":
        """The vehicle with these effects, each in the place of the one that it had under the same name."""
        added = {effect.name: effect for effect in effects}
        kept = (effect for effect in self.effects if effect.name not in added)
        return replace(self, effects=(*kept, *added.values()))

    def with_unnamed(self, curves: Iterable[UnnamedCurve]) -> "Vehicle":
        """The vehicle with these curves, besides those that it had."""
        return replace(self, unnamed=(*self.unnamed, *curves))


def size_of(body: Body, motors: Motors, battery: Battery) -> Size:
    """Magnitudes of a vehicle from which the sizes of effects follow."""
    weight = body.mass.value * GRAVITY
    known = motors.thrust_coefficient
    current = battery.motor_current_per_newton.value * weight
    return Size(
        mass=body.mass.value,
        arm=math.hypot(body.arm_x.value, body.arm_y.value),
        radius=body.propeller_radius.value,
        rotor_speed=REFERENCE.rotor_speed if known is None else math.sqrt(0.25 * weight / known.value),
        resistance=REFERENCE.resistance if current == 0.0 else battery.open_circuit_full.value / current,
    )
