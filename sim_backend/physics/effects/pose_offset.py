"""pose_offset: the tracked frame has its origin beside that of the body, p_seen = p + R offset."""

from collections.abc import Mapping
from typing import Any

from sim_backend.physics.effects.term import Acts, EffectTerm, Field


def _apply(p: Any, values: Mapping[str, float]) -> None:
    p["pose_offset"] = [values["x"], values["y"], values["z"]]


EFFECT = EffectTerm("pose_offset", Acts.SENSORS, _apply, (Field("pose_offset", (3,)),))
