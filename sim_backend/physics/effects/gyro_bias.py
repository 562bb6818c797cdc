"""gyro_bias: what is left after the calibration at start, w_seen = w + bias."""

from collections.abc import Mapping
from typing import Any

from sim_backend.physics.effects.term import Acts, EffectTerm, Field


def _apply(p: Any, values: Mapping[str, float]) -> None:
    p["gyro_bias"] = [values["x"], values["y"], values["z"]]


EFFECT = EffectTerm("gyro_bias", Acts.SENSORS, _apply, (Field("gyro_bias", (3,)),))
