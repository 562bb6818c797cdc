"""propeller_reach: of a propeller's disc only a part meets ceiling and floor, radius -> scale radius.

Two blades that stand at any angle reach 2/pi of the disc's radius in the mean, and blades bend.
"""

from collections.abc import Mapping
from typing import Any

from sim_backend.physics.effects.term import Acts, EffectTerm


def _apply(p: Any, values: Mapping[str, float]) -> None:
    p["rim_radius"] *= values["scale"]


EFFECT = EffectTerm("propeller_reach", Acts.ONCE, _apply)
