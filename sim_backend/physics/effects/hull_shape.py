"""hull_shape: the box of the body that meets ceiling and floor is wider, higher or deeper than filed.

The eight corners of docs/physics.md (Hull and propellers) move: half widths grow by `width`, the upper face
rises by `top`, the lower one sinks by `bottom`. A box that takes in the motor mounts is wide, board and
battery alone are narrow; markers make it higher, the feet of motor mounts deeper. Discs of propellers stay
(``propeller_reach``).
"""

from collections.abc import Mapping
from typing import Any

from sim_backend.physics.effects.term import Acts, EffectTerm


def _apply(p: Any, values: Mapping[str, float]) -> None:
    for name in ("body_half_x", "body_half_y"):
        p[name] = max(float(p[name]) + values["width"], 0.0)
    p["body_top_z"] += values["top"]
    p["body_bottom_z"] -= values["bottom"]


EFFECT = EffectTerm("hull_shape", Acts.ONCE, _apply)
