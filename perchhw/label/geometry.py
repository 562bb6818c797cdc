"""Where a landed vehicle rests, from its geometry alone: heights, tilts and swing for four and for two feet.

Frames: world z up, body FLU. Lengths in m, angles in rad.
"""

import math
from dataclasses import dataclass

import numpy as np

from onboard.arrays import FloatArray
from onboard.gravity import GRAVITY
from onboard.vehicle import EFFECTS, Vehicle
from perchhw.errors import FlightStackError

_RIM_POINTS = 16


class LabelError(FlightStackError):
    """The flight cannot be labelled; the message says what is missing."""


@dataclass(frozen=True)
class LandingGeometry:
    """Rest of the inverted vehicle under a ceiling, with rigid legs.

    The hinges give way by about 2 deg under the weight (0.08 N m/rad), which the label's margins cover.

    Attributes:
        feet: feet in the body frame, shape (4, 3), front left first.
        body_points: corners of the hull box and points on the propeller rims, shape (n, 3).
        foot_radius: radius of a foot (m).
        two_leg_distance: body origin below the ceiling, hanging on two neighbouring feet (m; the larger of
            the two ways).
        two_leg_tilt: angle between the inverted b_z and the vertical on two neighbouring feet (rad; the
            smaller of the two ways).
        swing_hz: small-swing frequency about two fore or two side feet (Hz), (about b_y, about b_x).
    """

    feet: FloatArray
    body_points: FloatArray
    foot_radius: float
    two_leg_distance: float
    two_leg_tilt: float
    swing_hz: tuple[float, float]

    def touch_margin(self, rotation: FloatArray) -> float:
        """How far (m) the highest foot is above the highest body or propeller point at attitude `rotation`.

        Positive: in this attitude a foot meets the ceiling first. `rotation` is body to world, shape (3, 3).
        """
        upward = rotation[2]
        return float(np.max(self.feet @ upward) + self.foot_radius - np.max(self.body_points @ upward))

    def body_top(self, rotations: FloatArray) -> FloatArray:
        """Height (m) of the highest body or propeller point above the body origin; (n, 3, 3) gives (n,)."""
        return np.max(rotations[:, 2, :] @ self.body_points.T, axis=1)

    def feet_top(self, rotations: FloatArray) -> FloatArray:
        """Height (m) of the highest (undeflected) foot above the body origin; (n, 3, 3) gives (n,)."""
        return np.max(rotations[:, 2, :] @ self.feet.T, axis=1) + self.foot_radius


def landing_geometry(vehicle: Vehicle) -> LandingGeometry:
    """The rest geometry of `vehicle`.

    Raises:
        LabelError: the vehicle has no legs.
    """
    legs = vehicle.legs
    if legs is None:
        raise LabelError(f"vehicle {vehicle.name} has no legs: a landing needs a leg design (--legs NAME)")
    reach = legs.length.value * math.sin(legs.angle) / math.sqrt(2.0)  # legs lean along the diagonal
    foot_x, foot_y = legs.hip_x.value + reach, legs.hip_y.value + reach
    depth = legs.length.value * math.cos(legs.angle) - legs.hip_z.value
    feet = np.array([(sx * foot_x, sy * foot_y, -depth) for sx, sy in ((1, 1), (1, -1), (-1, -1), (-1, 1))])
    radius = legs.foot_radius.value
    body = vehicle.body
    return LandingGeometry(
        feet=feet,
        body_points=_body_points(vehicle),
        foot_radius=radius,
        two_leg_distance=math.hypot(max(foot_x, foot_y), depth) + radius,
        two_leg_tilt=math.atan2(min(foot_x, foot_y), depth),
        swing_hz=(
            _pendulum_hz(body.mass.value, body.inertia_yy.value, math.hypot(foot_x, depth)),
            _pendulum_hz(body.mass.value, body.inertia_xx.value, math.hypot(foot_y, depth)),
        ),
    )


def _body_points(vehicle: Vehicle) -> FloatArray:
    body = vehicle.body
    shape = _effect(vehicle, "hull_shape")
    half_x, half_y = (max(half.value + shape["width"], 0.0) for half in (body.body_half_x, body.body_half_y))
    box = [
        (sx * half_x, sy * half_y, z)
        for sx in (1, -1)
        for sy in (1, -1)
        for z in (body.body_top_z.value + shape["top"], body.body_bottom_z.value - shape["bottom"])
    ]
    angles = np.linspace(0.0, 2.0 * math.pi, _RIM_POINTS, endpoint=False)
    reach = _effect(vehicle, "propeller_reach")["scale"]
    radius, height = reach * body.propeller_radius.value, body.propeller_height_z.value
    rims = [
        (
            sx * body.arm_x.value + radius * math.cos(a),
            sy * body.arm_y.value + radius * math.sin(a),
            height,
        )
        for sx in (1, -1)
        for sy in (1, -1)
        for a in angles
    ]
    return np.array(box + rims, dtype=np.float64)


def _effect(vehicle: Vehicle, name: str) -> dict[str, float]:
    """Values of an effect of the vehicle; the neutral ones where it has none."""
    found = (effect.values() for effect in vehicle.effects if effect.name == name)
    return next(found, EFFECTS[name].values({}))


def _pendulum_hz(mass: float, inertia: float, length: float) -> float:
    return math.sqrt(mass * GRAVITY * length / (inertia + mass * length**2)) / (2.0 * math.pi)
