"""pad_damping: a pad that holds resists being turned, M = -c (u x du/dt), u along the rod.

With v the velocity of the hip and L the distance to the foot, du/dt = -v_across / L. On a massless rod the
couple M at the foot comes with a force r x M / L^2 there; the two together are the force -(c / L^2) v_across
at the hip, which only takes energy.
"""

from collections.abc import Mapping
from typing import Any

from onboard.arrays import Vector
from sim_backend.physics.effects.term import Acts, EffectTerm, Field
from sim_backend.physics.frames import Rotation, Wrench, cross, to_body
from sim_backend.physics.jit import inner, outlined
from sim_backend.physics.rods import Rod
from sim_backend.physics.state import FootMode

_ATTACHED = int(FootMode.ATTACHED)


def _apply(p: Any, values: Mapping[str, float]) -> None:
    p["pad_damping"] = values["coefficient"]


EFFECT = EffectTerm("pad_damping", Acts.ONCE, _apply, (Field("pad_damping"),))


@inner
def damping_at_hip(state: Any, p: Any, leg: int, rod: Rod, v: Vector, w: Vector) -> Wrench:
    """Wrench (N, N m, body frame) of one pad on the body; zero while it does not hold.

    Args:
        state, p: the vehicle.
        leg: index 0..3. rod: its rod in the middle of the step.
        v, w: velocity (m/s) and rate (rad/s), body frame.
    """
    if state.foot_mode[leg] != _ATTACHED:
        return 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    hip = (p.hip[leg, 0], p.hip[leg, 1], p.hip[leg, 2])
    turn = cross(w, hip)
    x, y, z = v[0] + turn[0], v[1] + turn[1], v[2] + turn[2]
    along = rod[0] * x + rod[1] * y + rod[2] * z
    length = p.leg_length + rod[6]
    gain = -p.pad_damping / (length * length)
    force = (gain * (x - along * rod[0]), gain * (y - along * rod[1]), gain * (z - along * rod[2]))
    moment = cross(hip, force)
    return force[0], force[1], force[2], moment[0], moment[1], moment[2]


@outlined
def pad_wrench(state: Any, p: Any, rot: Rotation, a: Rod, b: Rod, c: Rod, d: Rod) -> Wrench:
    """Wrench (N, N m, body frame) of all pads, from the rods of legs 1 to 4 in the middle of the step."""
    velocity = state.velocity
    v = to_body(rot, velocity[0], velocity[1], velocity[2])
    w = (state.omega[0], state.omega[1], state.omega[2])
    total = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    for leg, rod in enumerate((a, b, c, d)):
        one = damping_at_hip(state, p, leg, rod, v, w)
        total = (
            total[0] + one[0], total[1] + one[1], total[2] + one[2],
            total[3] + one[3], total[4] + one[4], total[5] + one[5],
        )  # fmt: skip
    return total
