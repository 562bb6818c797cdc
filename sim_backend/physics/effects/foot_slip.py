"""foot_slip: feet come off at a pull, or attach only after a push, that the vehicle file does not know.

The stricter of file and effect holds.
"""

from collections.abc import Mapping
from typing import Any

from sim_backend.physics.effects.term import Acts, EffectTerm


def _apply(p: Any, values: Mapping[str, float]) -> None:
    p["adhesion_strength"] = min(float(p["adhesion_strength"]), values["adhesion_strength"])
    p["minimum_preload"] = max(float(p["minimum_preload"]), values["minimum_preload"])


EFFECT = EffectTerm("foot_slip", Acts.ONCE, _apply)
