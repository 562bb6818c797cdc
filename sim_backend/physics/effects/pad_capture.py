"""pad_capture: a foot that comes slowly does not stick.

A foot that touches the ceiling adheres when its speed along the normal, v_n = (v + R (w x r)).z, is at least

    v_c + s z,    z standard normal, one draw a landing,

so that a foot with v_n sticks with probability Phi((v_n - v_c) / s). Otherwise it presses with friction,
slides, and comes off when the push ends; it may stick again once it has been clear of the ceiling. z is
``pad_deviate`` of the state: who starts a landing draws it, and the same state gives the same landing.

The bond of a soft adhesive grows with the pressure and the time of the contact (Creton and Leibler, J. Polym.
Sci. B 34, 545, 1996); both grow with the speed at which a sprung leg meets the surface. A limit in the speed
is the least that says this, not a law of the pad.
"""

from collections.abc import Mapping
from typing import Any

from sim_backend.physics.effects.term import Acts, EffectTerm, Field


def _apply(p: Any, values: Mapping[str, float]) -> None:
    p["capture_speed"] = values["speed"]
    p["capture_spread"] = values["spread"]


EFFECT = EffectTerm("pad_capture", Acts.ONCE, _apply, (Field("capture_speed"), Field("capture_spread")))
