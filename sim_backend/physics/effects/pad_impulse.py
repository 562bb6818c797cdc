"""pad_impulse: a foot takes hold once it has been pressed for long enough.

A foot that presses against the ceiling adheres as soon as the impulse of its push since the touch,

    J = integral F_n dt  >=  impulse + spread z,    z standard normal, one draw a landing

(``pad_deviate`` of the state). Until then it slides with friction; clear of the ceiling it begins anew. The
bond of a soft adhesive grows with the pressure and the time of the contact (Creton and Leibler, J. Polym.
Sci. B 34, 545, 1996): their product is the least that says so. A foot that is thrown at the ceiling with a
mass m behind it gets m v (1 + restitution), whatever the stiffness of the leg.
"""

from collections.abc import Mapping
from typing import Any

from sim_backend.physics.effects.term import Acts, EffectTerm, Field


def _apply(p: Any, values: Mapping[str, float]) -> None:
    p["pad_impulse"] = values["impulse"]
    p["pad_impulse_spread"] = values["spread"]


EFFECT = EffectTerm("pad_impulse", Acts.ONCE, _apply, (Field("pad_impulse"), Field("pad_impulse_spread")))
