"""pose_delay: the tracked pose is older than anybody says, pose seen at t = pose at t - delay."""

from collections.abc import Mapping
from typing import Any

from sim_backend.physics.effects.term import Acts, EffectTerm, Field


def _apply(p: Any, values: Mapping[str, float]) -> None:
    p["pose_delay"] = values["delay"]


EFFECT = EffectTerm("pose_delay", Acts.SENSORS, _apply, (Field("pose_delay"),))
