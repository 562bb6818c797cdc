"""battery_sag: more resistance between the cell and the motors, V = E - (R + resistance) I."""

from collections.abc import Mapping
from typing import Any

from sim_backend.physics.effects.term import Acts, EffectTerm


def _apply(p: Any, values: Mapping[str, float]) -> None:
    p["battery_resistance"] += values["resistance"]


EFFECT = EffectTerm("battery_sag", Acts.ONCE, _apply)
