"""inertia_error: the moments of inertia are I_kk (1 + relative_k). The controller still believes in I_kk."""

from collections.abc import Mapping
from typing import Any

from sim_backend.physics.effects.term import Acts, EffectTerm


def _apply(p: Any, values: Mapping[str, float]) -> None:
    p["inertia"] *= [1.0 + values["xx"], 1.0 + values["yy"], 1.0 + values["zz"]]


EFFECT = EffectTerm("inertia_error", Acts.ONCE, _apply)
