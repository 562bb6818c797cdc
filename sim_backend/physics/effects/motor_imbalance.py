"""motor_imbalance: rotors differ, F_i = m_i F*_i. The factors go into the gains of thrust_scale."""

from collections.abc import Mapping
from typing import Any

from sim_backend.physics.effects.term import Acts, EffectTerm


def _apply(p: Any, values: Mapping[str, float]) -> None:
    p["command_gain"] *= [values["m1"], values["m2"], values["m3"], values["m4"]]


EFFECT = EffectTerm("motor_imbalance", Acts.COMMAND, _apply)
