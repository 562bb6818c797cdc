"""mass_error: the vehicle weighs m (1 + relative). Controller and policy still believe in m."""

from collections.abc import Mapping
from typing import Any

from sim_backend.physics.effects.term import Acts, EffectTerm


def _apply(p: Any, values: Mapping[str, float]) -> None:
    p["mass"] *= 1.0 + values["relative"]


EFFECT = EffectTerm("mass_error", Acts.ONCE, _apply)
