"""linear_drag: drag of the whole vehicle in proportion to its speed, f_k = -k u_k along each body axis.

It adds to the drag of the vehicle file's ``[air]``. Unlike rotor_drag it acts at the centre of mass and does
not go with the speed of the rotors.
"""

from collections.abc import Mapping
from typing import Any

from sim_backend.physics.effects.term import Acts, EffectTerm


def _apply(p: Any, values: Mapping[str, float]) -> None:
    for axis, name in enumerate("xyz"):
        p["drag"][axis] += values[name]


EFFECT = EffectTerm("linear_drag", Acts.ONCE, _apply)
