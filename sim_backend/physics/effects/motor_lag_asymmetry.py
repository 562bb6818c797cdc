"""motor_lag_asymmetry: spin-down over spin-up differs from the file by `ratio`, their mean (geometric) not.

So it is independent of motor_lag: one moves both time constants together, the other apart.
"""

import math
from collections.abc import Mapping
from typing import Any

from sim_backend.physics.effects.term import Acts, EffectTerm


def _apply(p: Any, values: Mapping[str, float]) -> None:
    root = math.sqrt(values["ratio"])
    p["time_constant_up"] /= root
    p["time_constant_down"] *= root


EFFECT = EffectTerm("motor_lag_asymmetry", Acts.ONCE, _apply)
