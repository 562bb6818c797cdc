"""motor_lag: motors slower or faster than filed, both time constants of the thrust times `scale`."""

from collections.abc import Mapping
from typing import Any

from sim_backend.physics.effects.term import Acts, EffectTerm


def _apply(p: Any, values: Mapping[str, float]) -> None:
    p["time_constant_up"] *= values["scale"]
    p["time_constant_down"] *= values["scale"]


EFFECT = EffectTerm("motor_lag", Acts.ONCE, _apply)
