"""pose_rotation: the tracked frame is turned against the body, q_seen = q exp(r / 2), r about body axes."""

from collections.abc import Mapping
from typing import Any

from onboard.rotation import from_rotation_vector
from sim_backend.physics.effects.term import Acts, EffectTerm, Field


def _apply(p: Any, values: Mapping[str, float]) -> None:
    p["pose_turn"] = from_rotation_vector((values["x"], values["y"], values["z"]))[:3]


EFFECT = EffectTerm(
    "pose_rotation",
    Acts.SENSORS,
    _apply,
    (Field("pose_turn", (3,)),),  # vector part of the unit quaternion from body to tracked frame
)
