"""The parameters of the physics as one numpy record, made from a vehicle file and a room."""

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from onboard.gravity import GRAVITY
from onboard.room import RoomGeometry
from onboard.vehicle import Legs, Vehicle
from sim_backend.physics.effects.registry import FIELDS, apply_effects
from sim_backend.physics.unnamed import FIELDS as UNNAMED_FIELDS
from sim_backend.physics.unnamed import apply_unnamed

RESTITUTION = 0.3
"""Body and propellers against a surface: hard plastic and blades on plywood, engineering estimate."""

FRICTION = 0.5
"""Coulomb coefficient of body and propellers on a surface, engineering estimate."""

FOOT_FRICTION = 1.0
"""Coulomb coefficient of a foot that touches without adhering; the value of the authors' simulation."""

LIMIT_STIFFNESS_RATIO = 10.0
"""Stiffness of the hinge's stop relative to the hinge spring."""

PARAMETERS = np.dtype(
    [
        ("mass", "f8"),
        ("inertia", "f8", (3,)),  # kg m2, diagonal
        ("arm_x", "f8"),
        ("arm_y", "f8"),
        ("thrust_to_torque", "f8"),
        ("thrust_max", "f8"),  # N, what one motor can give
        ("time_constant_up", "f8"),
        ("time_constant_down", "f8"),
        ("thrust_map_form", "i8"),
        ("thrust_map_coefficients", "f8", (8,)),
        ("open_circuit_full", "f8"),
        ("open_circuit_slope", "f8"),  # V over the capacity
        ("battery_capacity", "f8"),  # C
        ("battery_resistance", "f8"),
        ("current_per_newton", "f8"),
        ("drag", "f8", (3,)),  # N s/m, body axes
        ("has_legs", "i8"),
        ("hip", "f8", (4, 3)),
        ("leg_direction", "f8", (4, 3)),  # unit, body frame, hip to foot at rest
        ("leg_sideways", "f8", (4, 2)),  # x and y of the unit normal of the leg's plane, which holds b_z
        ("leg_length", "f8"),
        ("foot_radius", "f8"),
        ("hinge_stiffness", "f8"),
        ("hinge_damping", "f8"),
        ("hinge_limit", "f8"),
        ("hinge_limit_cosine", "f8"),
        ("hinge_limit_stiffness", "f8"),
        ("axial_stiffness", "f8"),
        ("axial_damping", "f8"),
        ("adhesion_strength", "f8"),
        ("minimum_preload", "f8"),
        ("foot_friction", "f8"),
        ("body_half_x", "f8"),
        ("body_half_y", "f8"),
        ("body_top_z", "f8"),
        ("body_bottom_z", "f8"),
        ("propeller_radius", "f8"),
        ("rim_radius", "f8"),  # m, of the disc that meets a surface
        ("propeller_height_z", "f8"),
        ("restitution", "f8"),
        ("friction", "f8"),
        ("reach", "f8"),  # m, farthest point of the vehicle from its origin
        ("ceiling_z", "f8"),
        ("gravity", "f8"),
        ("hub", "f8", (4, 3)),  # m, rotors, body frame
        ("hover_thrust", "f8"),  # N, a quarter of the weight in the vehicle file
        ("thrust_per_speed2", "f8"),  # N s2/rad2, thrust over the square of the rotor speed; 0 when not known
        ("speed2_per_thrust", "f8"),  # rad2/(N s2), its inverse; 0 when not known
        ("command_on", "i8"),  # 1: the vehicle has effects on what the motors are told,
        ("motors_on", "i8"),  # on how they follow,
        ("forces_on", "i8"),  # on the forces,
        ("sensors_on", "i8"),  # on what is measured
        *((field.name, "f8", field.shape) for field in FIELDS),
        *UNNAMED_FIELDS,
    ],
    align=True,
)

_NO_EFFECTS = np.zeros(1, dtype=PARAMETERS)
for _field in FIELDS:
    _NO_EFFECTS[_field.name] = _field.default

_QUADRANTS = np.array([[1.0, -1.0], [-1.0, -1.0], [-1.0, 1.0], [1.0, 1.0]])


def physics_parameters(vehicle: Vehicle, room: RoomGeometry) -> Any:
    """The record of parameters for one vehicle in one room.

    Raises:
        SimulationError: the vehicle has an effect that the physics has no equation for.
    """
    p = _NO_EFFECTS.copy()[0]
    body, motors, battery = vehicle.body, vehicle.motors, vehicle.battery
    p["mass"] = body.mass.value
    p["inertia"] = [body.inertia_xx.value, body.inertia_yy.value, body.inertia_zz.value]
    p["arm_x"], p["arm_y"] = body.arm_x.value, body.arm_y.value
    for name in ("body_half_x", "body_half_y", "body_top_z", "body_bottom_z"):
        p[name] = getattr(body, name).value
    p["propeller_radius"], p["propeller_height_z"] = (
        body.propeller_radius.value,
        body.propeller_height_z.value,
    )
    p["rim_radius"] = p["propeller_radius"]
    for name in ("thrust_to_torque", "thrust_max", "time_constant_up", "time_constant_down"):
        p[name] = getattr(motors, name).value
    thrust_map = motors.thrust_map_compiled()
    p["thrust_map_form"], p["thrust_map_coefficients"] = thrust_map.form, thrust_map.coefficients
    p["open_circuit_full"] = battery.open_circuit_full.value
    p["open_circuit_slope"] = battery.open_circuit_slope.value
    p["battery_capacity"] = battery.capacity.value
    p["battery_resistance"] = battery.resistance.value
    p["current_per_newton"] = battery.motor_current_per_newton.value
    p["drag"] = [vehicle.air.drag_x.value, vehicle.air.drag_y.value, vehicle.air.drag_z.value]
    p["restitution"], p["friction"], p["foot_friction"] = RESTITUTION, FRICTION, FOOT_FRICTION
    p["ceiling_z"], p["gravity"] = room.ceiling_z, GRAVITY
    if vehicle.legs is not None:
        _set_legs(p, vehicle.legs)
    _prepare_effects(p, vehicle)
    apply_effects(p, vehicle)
    apply_unnamed(p, vehicle)
    p["reach"] = _reach(p)
    return p


def _prepare_effects(p: Any, vehicle: Vehicle) -> None:
    """What effects start from: places of the rotors, and hover."""
    p["hub"][:, :2] = _QUADRANTS * (p["arm_x"], p["arm_y"])
    p["hub"][:, 2] = p["propeller_height_z"]
    p["hover_thrust"] = 0.25 * p["mass"] * p["gravity"]
    coefficient = vehicle.motors.thrust_coefficient
    if coefficient is not None:
        p["thrust_per_speed2"], p["speed2_per_thrust"] = coefficient.value, 1.0 / coefficient.value


def _set_legs(p: Any, legs: Legs) -> None:
    p["has_legs"] = 1
    psi = legs.angle
    hip_xy = np.array([legs.hip_x.value, legs.hip_y.value])
    p["hip"][:, :2] = _QUADRANTS * hip_xy
    p["hip"][:, 2] = legs.hip_z.value
    # The leg leans outwards along the diagonal of its quadrant.
    p["leg_direction"][:, :2] = _QUADRANTS * (math.sin(psi) / math.sqrt(2.0))
    p["leg_direction"][:, 2] = -math.cos(psi)
    p["leg_sideways"] = _QUADRANTS[:, ::-1] * (-1.0, 1.0) / math.sqrt(2.0)
    p["leg_length"], p["foot_radius"] = legs.length.value, legs.foot_radius.value
    p["hinge_stiffness"], p["hinge_damping"] = legs.stiffness.value, legs.damping.value
    p["hinge_limit"] = legs.deflection_limit.value
    p["hinge_limit_cosine"] = math.cos(legs.deflection_limit.value)
    p["hinge_limit_stiffness"] = LIMIT_STIFFNESS_RATIO * legs.stiffness.value
    p["axial_stiffness"], p["axial_damping"] = legs.axial_stiffness.value, legs.axial_damping.value
    p["adhesion_strength"], p["minimum_preload"] = legs.adhesion_limit, legs.minimum_preload.value


def _reach(p: Any) -> float:
    z = max(abs(float(p["body_top_z"])), abs(float(p["body_bottom_z"])))
    corner = math.hypot(p["body_half_x"], p["body_half_y"], z)
    hub = math.hypot(p["arm_x"], p["arm_y"]) + p["rim_radius"]
    rim = math.hypot(hub, p["propeller_height_z"])
    foot = 0.0
    if p["has_legs"]:
        feet = p["hip"] + p["leg_length"] * p["leg_direction"]
        foot = float(np.max(np.linalg.norm(feet, axis=1))) + float(p["foot_radius"])
    # Hips already are where the centre of mass puts them; hull and propellers are sideways of it.
    return max(corner, rim, foot) + math.hypot(*p["geometric_centre"][:2])


def parameter_batch(parameters: Any, count: int) -> NDArray[np.void]:
    """`count` copies of one record, to be varied one by one (domain randomisation)."""
    return np.repeat(np.array(parameters, dtype=PARAMETERS).reshape(1), count)
