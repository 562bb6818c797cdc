"""Vehicles that may explain how landings end: legs, pads, propellers, hull on a grid, and what each predicts.

A vehicle of the grid has these effects at values of its own in place of those of the vehicle file, so that a
file that has them already is judged as it is, and the values are what its effects should be.
"""

import math
from collections.abc import Iterable, Sequence
from dataclasses import replace
from itertools import product
from typing import Any, NamedTuple

from calibration.gap.landings.outcomes.pad_laws import PadLaw, pad_laws
from onboard.room import RoomGeometry
from onboard.vehicle import EFFECTS, Effect, Vehicle
from sim_backend.physics.effects.registry import TERMS
from sim_backend.physics.parameters import physics_parameters


class Point(NamedTuple):
    """A vehicle of the grid: parameters of its effects; the defaults are a vehicle without them."""

    stiffness: float = 1.0
    damping: float = 1.0
    speed: float = 0.0
    spread: float = 0.0
    reach: float = 1.0
    preload: float = 0.0
    preload_spread: float = 0.0
    impulse: float = 0.0
    impulse_spread: float = 0.0
    angle: float = math.pi
    angle_spread: float = 0.0
    side_stiffness: float = 1.0
    side_damping: float = 1.0
    width: float = 0.0
    top: float = 0.0
    bottom: float = 0.0


EFFECT_OF = {
    "stiffness": ("leg_stiffness", "scale"),
    "damping": ("leg_damping", "scale"),
    "speed": ("pad_capture", "speed"),
    "spread": ("pad_capture", "spread"),
    "reach": ("propeller_reach", "scale"),
    "preload": ("foot_slip", "minimum_preload"),
    "preload_spread": ("foot_slip", "preload_spread"),
    "impulse": ("pad_impulse", "impulse"),
    "impulse_spread": ("pad_impulse", "spread"),
    "angle": ("pad_angle", "angle"),
    "angle_spread": ("pad_angle", "spread"),
    "side_stiffness": ("leg_sideways", "stiffness"),
    "side_damping": ("leg_sideways", "damping"),
    "width": ("hull_shape", "width"),
    "top": ("hull_shape", "top"),
    "bottom": ("hull_shape", "bottom"),
}
"""Effect and parameter of the vehicle file that each coordinate stands for."""

UNITS = {name: EFFECTS[effect].parameters[parameter].unit for name, (effect, parameter) in EFFECT_OF.items()}

WITHOUT = Point()
"""None of the effects."""

NATURAL_ENDS: dict[str, tuple[float, ...]] = {
    **dict.fromkeys(("stiffness", "damping", "side_stiffness", "side_damping"), ()),
    **dict.fromkeys(("speed", "preload", "impulse"), (0.0,)),
    **dict.fromkeys(("spread", "preload_spread", "impulse_spread", "angle_spread"), (0.0,)),
    "angle": (math.pi,),
    "reach": (1.0, 0.0),
}
"""Values beyond which there is nothing, by coordinate: no limit and no spread of it, the whole propeller,
none of it. Hulls are no ladder but a few shapes, and have no ends."""

HINGES = ((1.0, 1.0), (1.0, 8.0), (1.6, 8.0), (1.6, 16.0))
"""Stiffness and damping: as the legs are filed, and around what the motion after the contact shows (docs)."""

REACHES = (1.0, 0.64, 0.3)
"""Share of the propeller's radius that meets the ceiling: a disc, two blades at any angle, nearly none."""


AXES = ((1.0, 1.0), (0.5, 0.5), (2.0, 2.0), (4.0, 4.0), (1.0, 4.0))
"""Stiffness and damping across the leg's plane over those in it: alike, half, the authors' simulated hinge, a
strip twice as wide as thick, dampers alone."""

HULLS = ((0.0, 0.0, 0.0), (-0.7, 0.0, 0.0), (0.0, 0.3, 0.0), (0.0, 0.0, 0.2))
"""What is added to half widths, top and bottom of the box, over the length of an arm: nothing, the board
alone, markers above, feet of the motor mounts below (of a Crazyflie 23, 10 and 6.5 mm)."""


def shapes(parameters: Any) -> list[dict[str, float]]:
    """Hinges of two axes and hulls that are tried, as coordinates, for a vehicle's physics parameters."""
    arm = float(parameters["arm_x"])
    hulls = [
        dict(zip(("width", "top", "bottom"), (arm * share for share in hull), strict=True)) for hull in HULLS
    ]
    return [*({"side_stiffness": k, "side_damping": c} for k, c in AXES), *hulls]


def filed_point(vehicle: Vehicle) -> Point:
    """What a vehicle file says of these effects."""
    values = {effect.name: effect.values() for effect in vehicle.effects}
    found = {
        name: values[effect][parameter] for name, (effect, parameter) in EFFECT_OF.items() if effect in values
    }
    return WITHOUT._replace(**found)


def stripped(effects: Sequence[Effect], coordinates: Iterable[str]) -> tuple[Effect, ...]:
    """Effects without what some coordinates stand for; what else they say stays."""
    gone = {EFFECT_OF[name] for name in coordinates}
    left = {
        effect.name: {name: q for name, q in effect.parameters.items() if (effect.name, name) not in gone}
        for effect in effects
    }
    return tuple(Effect(name=name, parameters=parameters) for name, parameters in left.items() if parameters)


def bare_parameters(vehicle: Vehicle) -> Any:
    """Physics parameters of a vehicle without these effects: what :func:`with_point` begins with."""
    return physics_parameters(replace(vehicle, effects=stripped(vehicle.effects, EFFECT_OF)), RoomGeometry())


def without_pads(point: Point, laws: dict[str, PadLaw]) -> Point:
    """The vehicle whose feet stick whatever they do."""
    names = [name for law in laws.values() for name in (law.limit, law.spread)]
    return point._replace(**{name: getattr(WITHOUT, name) for name in names})


def grid(parameters: Any, filed: Point = WITHOUT) -> tuple[Point, ...]:
    """All vehicles, those of the file's own values among them.

    Hinges, pads and propellers in all combinations. The other laws of pads come one at a time, with all
    hinges and the propellers as filed; and so do second axes and hulls, with all hinges and pads.

    Args:
        parameters: of the vehicle without these effects. filed: what its file says.
    """
    laws = pad_laws(parameters)
    speeds = {"pads": laws["pads"]}
    hinges = dict.fromkeys([*HINGES, (filed.stiffness, filed.damping)])
    reaches = dict.fromkeys([*REACHES, filed.reach])
    found: dict[Point, None] = {}
    for stiffness, damping in hinges:
        legs = filed._replace(stiffness=stiffness, damping=damping)
        for reach in reaches:
            found |= _padded(legs._replace(reach=reach), laws, laws if reach == filed.reach else speeds)
        for shape in shapes(parameters):
            found |= _padded(legs._replace(**shape), laws, speeds)
    return tuple(found)


def _padded(point: Point, laws: dict[str, PadLaw], tried: dict[str, PadLaw]) -> dict[Point, None]:
    """A vehicle with its pads, without any, and with those of the laws that are tried."""
    body = without_pads(point, laws)
    found = dict.fromkeys([point, body])
    for law in tried.values():
        pairs = product(law.means, law.spreads)
        found |= dict.fromkeys(body._replace(**{law.limit: m, law.spread: s}) for m, s in pairs)
    return found


def with_point(parameters: Any, point: Point) -> Any:
    """A copy of a record of parameters without these effects that has those of a point."""
    changed = parameters.copy()
    values: dict[str, dict[str, float]] = {}
    for name, value in point._asdict().items():
        effect, parameter = EFFECT_OF[name]
        values.setdefault(effect, EFFECTS[effect].values({}))[parameter] = value
    for effect, given in values.items():
        TERMS[effect].apply(changed, given)
    return changed
