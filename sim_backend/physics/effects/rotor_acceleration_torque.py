"""rotor_acceleration_torque: who speeds a rotor up is turned the other way, tau_z = -J dH/dt,
H = w1 - w2 + w3 - w4 (M1 and M3 turn counter-clockwise seen from above).

The mean of dH/dt over the step is taken, so that the angular momentum of body and rotors about b_z stays what
it was, also for a rotor that starts from rest.
"""

from collections.abc import Mapping
from typing import Any

from sim_backend.physics.effects.term import Acts, EffectTerm, Field
from sim_backend.physics.jit import inner


@inner
def acceleration_torque(state: Any, p: Any) -> float:
    """Torque (N m) about b_z for the rotor accelerations in the state."""
    rate = state.rotor_acceleration
    return -p.accelerated_inertia * (rate[0] - rate[1] + rate[2] - rate[3])


def _apply(p: Any, values: Mapping[str, float]) -> None:
    p["accelerated_inertia"] = values["rotor_inertia"]
    p["forces_on"] = 1


EFFECT = EffectTerm("rotor_acceleration_torque", Acts.MOTORS, _apply, (Field("accelerated_inertia"),))
