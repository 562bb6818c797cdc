"""rotor_gyroscopic: the spinning rotors resist a turn, tau = -w x (J H e_z), H = w1 - w2 + w3 - w4.

M1 and M3 turn counter-clockwise seen from above. The torque is perpendicular to w: it does no work.
"""

from collections.abc import Mapping
from typing import Any

from sim_backend.physics.effects.term import Acts, EffectTerm, Field
from sim_backend.physics.jit import kernel


@kernel
def gyroscopic_torque(p: Any, spin: float, wx: float, wy: float) -> tuple[float, float]:
    """Torque (N m) about b_x and b_y for the sum `spin` of signed rotor speeds and the body rate (rad/s)."""
    momentum = p.gyroscopic_inertia * spin
    return -wy * momentum, wx * momentum


def _apply(p: Any, values: Mapping[str, float]) -> None:
    p["gyroscopic_inertia"] = values["rotor_inertia"]


EFFECT = EffectTerm("rotor_gyroscopic", Acts.FORCES, _apply, (Field("gyroscopic_inertia"),))
