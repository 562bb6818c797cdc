"""motor_saturation: a rotor gives no more than it can, F_i = min(F*_i, thrust_limit), whatever it is told."""

import math
from collections.abc import Mapping
from typing import Any

from sim_backend.physics.effects.term import Acts, EffectTerm, Field


def _apply(p: Any, values: Mapping[str, float]) -> None:
    p["thrust_limit"] = values["thrust_limit"]


EFFECT = EffectTerm("motor_saturation", Acts.COMMAND, _apply, (Field("thrust_limit", (), math.inf),))
