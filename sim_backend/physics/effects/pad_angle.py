"""pad_angle: a foot takes hold only while its pad lies nearly flat on the ceiling.

The pad's normal is the rod's direction u (hip to foot, world). A foot that presses adheres as soon as

    acos(u_z)  <=  angle - spread z,    z standard normal, one draw a landing

(``pad_deviate`` of the state; a large z is a bad pad, as for every limit). Until then it slides with
friction, while the body swings on and turns the rod. A flat pad that is tilted touches with its rim alone;
pads of mushroom-shaped pillars bear a tilt of their own size (Heepe, Carbone, Pierro, Kovalev, Gorb, Appl.
Phys. Lett. 104, 011906, 2014). So a limit is a hypothesis that landings have to bear out.
"""

import math
from collections.abc import Mapping
from typing import Any

from sim_backend.physics.effects.term import Acts, EffectTerm, Field


def _apply(p: Any, values: Mapping[str, float]) -> None:
    p["pad_angle"] = values["angle"]
    p["pad_angle_spread"] = values["spread"]


EFFECT = EffectTerm(
    "pad_angle", Acts.ONCE, _apply, (Field("pad_angle", default=math.pi), Field("pad_angle_spread"))
)
