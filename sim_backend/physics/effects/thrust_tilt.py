"""thrust_tilt: the rotors' axes lean, thrust along (tan x, tan y, 1), normed, at each hub.

`x` and `y` are the lean towards b_x and b_y (rad). The in-plane part acts at the height of the rotors, so it
turns the vehicle too.
"""

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from sim_backend.physics.effects.term import Acts, EffectTerm, Field


def _apply(p: Any, values: Mapping[str, float]) -> None:
    axis = np.array([math.tan(values["x"]), math.tan(values["y"]), 1.0])
    # x, y and what is missing of 1 along b_z
    p["thrust_lean"] = axis / np.linalg.norm(axis) - (0.0, 0.0, 1.0)


EFFECT = EffectTerm("thrust_tilt", Acts.FORCES, _apply, (Field("thrust_lean", (3,)),))
