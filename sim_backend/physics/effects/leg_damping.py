"""leg_damping: hinges are damped more or less than filed, c -> scale c."""

from collections.abc import Mapping
from typing import Any

from sim_backend.physics.effects.term import Acts, EffectTerm


def _apply(p: Any, values: Mapping[str, float]) -> None:
    p["hinge_damping"] *= values["scale"]


EFFECT = EffectTerm("leg_damping", Acts.ONCE, _apply)
