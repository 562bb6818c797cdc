"""translational_lift: a rotor that moves edgewise gives more thrust, because it meets fresh air.

Momentum theory of a rotor in level flight at speed u (Glauert, ARC R&M 1111, 1926; Leishman, Principles of
Helicopter Aerodynamics, 2nd ed. 2006, section 2.14) gives the induced velocity v_i by

    v_i^2 (v_i^2 + u^2) = v_h^4,    v_h^2 = F* / (2 rho pi R^2)

where v_h is that of hover. As under a ceiling (:mod:`.ceiling_effect`) a rotor at the same speed that meets
less inflow gives more: with blade element theory F = F* (1 + inflow) - inflow F* v_i/v_i0, where `inflow` is
the share of the thrust that its own inflow costs, so that y = sqrt(F/F*) follows from

    y^2 + inflow (v_i/v_h) y - (1 + inflow) = 0

The gain grows with u^2, F - F* = inflow/(2 + inflow) rho pi R^2 u^2 where u is well below v_h, and is at most
1 + inflow. What climb does is inflow_thrust_loss.
"""

import math
from collections.abc import Mapping
from typing import Any

from sim_backend.physics.effects.body_drag import AIR_DENSITY
from sim_backend.physics.effects.term import Acts, EffectTerm, Field
from sim_backend.physics.jit import inner


@inner
def lift_gain(p: Any, thrust: float, edgewise2: float) -> float:
    """F/F* of a rotor.

    Args:
        p: record of parameters.
        thrust: N, F*, in still air at this rotor speed.
        edgewise2: m2/s2, square of the hub's velocity through the air in the rotor's plane.
    """
    if p.lift_inflow == 0.0 or thrust <= 0.0:
        return 1.0
    half = 0.5 * p.lift_disc * edgewise2 / thrust
    share = 0.5 * p.lift_inflow * math.sqrt(math.sqrt(half * half + 1.0) - half)
    root = math.sqrt(share * share + 1.0 + p.lift_inflow) - share
    return root * root


def _apply(p: Any, values: Mapping[str, float]) -> None:
    p["lift_inflow"] = values["inflow"]
    p["lift_disc"] = 2.0 * AIR_DENSITY * math.pi * float(p["propeller_radius"]) ** 2


EFFECT = EffectTerm("translational_lift", Acts.FORCES, _apply, (Field("lift_inflow"), Field("lift_disc")))
