"""ground_effect: a rotor gives more thrust close above the floor, F = F* / (1 - strength (R / (4 h))^2).

Cheeseman, Bennett, ARC R&M 3021, 1955 (rotor over its mirror image, at constant power), strength 1; several
rotors close together have more. The formula has a pole that no rotor has: the gain ends at `MOST`. Each rotor
has its own height. The gain fades with the cosine of the tilt; a rotor that faces down has none.
"""

from collections.abc import Mapping
from typing import Any

from sim_backend.physics.effects.term import Acts, EffectTerm, Field
from sim_backend.physics.jit import kernel

MOST = 2.0
"""Largest gain, twice of what is measured on rotors that nearly touch the ground."""


@kernel
def ground_gain(p: Any, height: float, facing: float) -> float:
    """Thrust over that in open air.

    Args:
        p: parameters.
        height: m of the hub above the floor.
        facing: cosine of the angle between the rotor's axis and up.
    """
    if p.ground_reach2 == 0.0 or facing <= 0.0:
        return 1.0
    height2 = max(height * abs(height), p.ground_reach2 * MOST / (MOST - 1.0))
    return 1.0 + facing * p.ground_reach2 / (height2 - p.ground_reach2)


def _apply(p: Any, values: Mapping[str, float]) -> None:
    p["ground_reach2"] = values["strength"] * (0.25 * float(p["propeller_radius"])) ** 2


EFFECT = EffectTerm("ground_effect", Acts.FORCES, _apply, (Field("ground_reach2"),))
