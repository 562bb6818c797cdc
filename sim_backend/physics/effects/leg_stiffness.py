"""leg_stiffness: hinges, and their stops, are stiffer or softer than filed, K -> scale K."""

from collections.abc import Mapping
from typing import Any

from sim_backend.physics.effects.term import Acts, EffectTerm


def _apply(p: Any, values: Mapping[str, float]) -> None:
    p["hinge_stiffness"] *= values["scale"]
    p["hinge_limit_stiffness"] *= values["scale"]


EFFECT = EffectTerm("leg_stiffness", Acts.ONCE, _apply)
