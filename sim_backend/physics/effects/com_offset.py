"""com_offset: the centre of mass lies at (x, y, z) from the middle between the rotors.

The body frame has its origin in the centre of mass: rotors, hips and hull move the other way. Mixer and
controller still believe in rotors at (+-arm_x, +-arm_y). The inertia in the vehicle file is that about the
centre of mass. What is tracked or called the origin of the drone stays in the middle, and so does the
board with its accelerometer: both are at `geometric_centre` in the body frame.
"""

from collections.abc import Mapping
from typing import Any

from sim_backend.physics.effects.term import Acts, EffectTerm, Field


def _apply(p: Any, values: Mapping[str, float]) -> None:
    offset = (values["x"], values["y"], values["z"])
    p["geometric_centre"] -= offset
    p["hub"] -= offset
    p["hip"] -= offset
    p["sensors_on"] = 1
    for name in ("body_top_z", "body_bottom_z", "propeller_height_z"):
        p[name] -= offset[2]


EFFECT = EffectTerm("com_offset", Acts.FORCES, _apply, (Field("geometric_centre", (3,)),))
