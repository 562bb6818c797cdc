"""thrust_scale: all rotors give more or less than expected, F_i = scale F*_i.

The thrust of a rotor is proportional to the density of the air and falls with the wear of its propeller.
"""

from collections.abc import Mapping
from typing import Any

from sim_backend.physics.effects.term import Acts, EffectTerm, Field


def _apply(p: Any, values: Mapping[str, float]) -> None:
    p["command_gain"] *= values["scale"]


EFFECT = EffectTerm(
    "thrust_scale",
    Acts.COMMAND,
    _apply,
    # 1, factor of each motor; that of motor_imbalance goes on top
    (Field("command_gain", (4,), 1.0),),
)
