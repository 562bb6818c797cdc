"""motor_speed_law: dw/dt = a (ws - w) + b (ws^2 - w^2), one pair (a, b) for rising and one for falling speed.

A brushed motor with a propeller obeys J dw/dt = kt (V - ke w)/R - kq w^2. Written about the settled speed ws,
b = kq/J is the drag of the propeller, and a = kt ke/(R J) the back electromotive force, which acts only while
the winding conducts: a motor that is told less coasts. One pair per direction describes steps of any size
(bench notes 1.2), which one time constant does not; it replaces the first-order thrust. Near ws the time
constant is 1/(a + 2 b ws).

With x = w - ws and alpha = a + 2 b ws this is Riccati's equation dx/dt = -alpha x - b x^2, solved by

    x(t) = alpha x0 e / (alpha + b x0 (1 - e)),  e = exp(-alpha t)

Here e is replaced by its Pade approximant (1 - y/2 + y^2/12) / (1 + y/2 + y^2/12), y = alpha t, whose error
is y^5/720: 1e-9 over a millisecond at most. alpha then cancels, and no exponential is needed.
"""

from collections.abc import Mapping
from typing import Any

from sim_backend.physics.effects.term import Acts, EffectTerm, Field
from sim_backend.physics.jit import kernel


@kernel
def speed_after(speed: float, settled: float, a: float, b: float, dt: float) -> float:
    """Rotor speed (rad/s) `dt` (s) later, on the way to `settled` (rad/s)."""
    x = speed - settled
    y = (a + 2.0 * b * settled) * dt
    curve = 1.0 + y * y / 12.0
    return settled + x * (curve - 0.5 * y) / (curve + 0.5 * y + b * dt * x)


def _apply(p: Any, values: Mapping[str, float]) -> None:
    p["speed_law_a"] = [values["a_up"], values["a_down"]]
    p["speed_law_b"] = [values["b_up"], values["b_down"]]


EFFECT = EffectTerm(
    "motor_speed_law",
    Acts.MOTORS,
    _apply,
    (Field("speed_law_a", (2,)), Field("speed_law_b", (2,))),  # up, down; b is zero without the law
)
