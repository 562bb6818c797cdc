"""rotor_drag: a spinning rotor resists motion in its plane, f_i = -k w_i (u_x, u_y, 0) at its hub.

u is the velocity of the hub through the air. Blades meet the air faster on one side than on the other (blade
flapping and induced drag; Mahony, Kumar, Corke 2012; Faessler, Franchi, Scaramuzza 2018, there summed over
the rotors and per mass). At the hubs the force makes a pitching moment and damps yaw as well.
"""

from collections.abc import Mapping
from typing import Any

from sim_backend.physics.effects.term import Acts, EffectTerm, Field
from sim_backend.physics.jit import inner


@inner
def rotor_drag(p: Any, speed: float, ux: float, uy: float) -> tuple[float, float]:
    """In-plane force (N) on a rotor of `speed` (rad/s) at the air-relative velocity (m/s) of its hub."""
    resistance = p.rotor_drag * speed
    return -resistance * ux, -resistance * uy


def _apply(p: Any, values: Mapping[str, float]) -> None:
    p["rotor_drag"] = values["coefficient"]


EFFECT = EffectTerm("rotor_drag", Acts.FORCES, _apply, (Field("rotor_drag"),))
