"""thrust_curve: a thrust map that is bent, F = F* (1 + curvature (F*/F_hover - 1)).

F_hover is a quarter of the weight in the vehicle file: there the curve agrees with the map, so that a scale
and a bend can be told apart.
"""

from collections.abc import Mapping
from typing import Any

from sim_backend.physics.effects.term import Acts, EffectTerm, Field
from sim_backend.physics.jit import kernel


@kernel
def bent(p: Any, thrust: float) -> float:
    """Thrust (N) that a motor heads for when it is told `thrust` (N); never negative."""
    return max(thrust * (1.0 - p.curvature + p.curvature_per_newton * thrust), 0.0)


def _apply(p: Any, values: Mapping[str, float]) -> None:
    p["curvature"] = values["curvature"]
    p["curvature_per_newton"] = values["curvature"] / p["hover_thrust"]


EFFECT = EffectTerm("thrust_curve", Acts.COMMAND, _apply, (Field("curvature"), Field("curvature_per_newton")))
