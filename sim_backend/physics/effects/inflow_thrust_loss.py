"""inflow_thrust_loss: a rotor that climbs through the air gives less thrust, F_i = F*_i - k w_i u_z.

A climb lowers the angle at which the blades meet the air; by blade element theory the loss is proportional to
rotor speed and climb (Svacha, Mohta, Kumar, ICUAS 2017). Different climbs of the four hubs damp roll and
pitch. A sinking rotor gains thrust; its vortex ring is not modelled.
"""

from collections.abc import Mapping
from typing import Any

from sim_backend.physics.effects.term import Acts, EffectTerm, Field
from sim_backend.physics.jit import inner


@inner
def inflow_loss(p: Any, speed: float, uz: float) -> float:
    """Thrust (N) lost at a rotor speed (rad/s) and an axial velocity of the hub through the air (m/s)."""
    return p.inflow_loss * speed * uz


def _apply(p: Any, values: Mapping[str, float]) -> None:
    p["inflow_loss"] = values["coefficient"]


EFFECT = EffectTerm("inflow_thrust_loss", Acts.FORCES, _apply, (Field("inflow_loss"),))
