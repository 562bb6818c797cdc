"""foot_slip: feet come off at a pull, or attach only after a push, that the vehicle file does not know.

The stricter of file and effect holds. The push that a foot needs is minimum_preload + preload_spread z, z
standard normal, one draw a landing (``pad_deviate`` of the state); a foot that presses takes hold as soon as
its push reaches it. Patterned dry adhesives hold the more, up to a plateau, the harder they were pressed
(Greiner, del Campo, Arzt, Langmuir 23, 3495, 2007); a least push is the sharpest form of it.
"""

from collections.abc import Mapping
from typing import Any

from sim_backend.physics.effects.term import Acts, EffectTerm, Field


def _apply(p: Any, values: Mapping[str, float]) -> None:
    p["adhesion_strength"] = min(float(p["adhesion_strength"]), values["adhesion_strength"])
    p["minimum_preload"] = max(float(p["minimum_preload"]), values["minimum_preload"])
    p["preload_spread"] = values["preload_spread"]


EFFECT = EffectTerm("foot_slip", Acts.ONCE, _apply, (Field("preload_spread"),))
