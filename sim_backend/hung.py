"""A drone without propellers on a thread: who speeds a rotor up is turned the other way, and keeps turning.

The thread lets it turn: torsion pendulum of a long period, never quite still. The bare rotors are those of
brushed 7x16 mm motors: driven in one direction only, and not braked: they coast against their friction.
"""

import math
from typing import Any

from onboard.gravity import GRAVITY
from sim_backend.handling import HELD_HEIGHT, Wiring

ROTOR_INERTIA = 4e-9
"""kg m2, engineering estimate, 2e-9 to 6e-9: the rotor of an 8x16 mm motor of the same kind has 5.1e-9 (data
sheet of the FAULHABER 0816 SR)."""
SPEED_PER_VOLT = 19000.0 * 2.0 * math.pi / 60.0
"""rad/s per V, of the motors of the paper's vehicle."""
TIME_CONSTANT_S = 0.008
"""s, mechanical, of a bare rotor: 6 ms in the same data sheet."""
FRICTION = 3.4e-5
"""N m of the brushes and bearings, by the same data sheet."""
PERIOD_S, RESTLESS = 4.0, math.radians(3.0)
"""s and rad/s: of the thread's torsion, and how fast the drone turns to and fro as it hangs there."""
SPINS = (1.0, -1.0, 1.0, -1.0)
"""Of rotors 1 to 4: positive counter-clockwise, seen from above."""


class HungDrone:
    """One drone on its thread; call :meth:`step` once a ms.

    Args:
        inertia: of the body about its vertical, kg m2.
        wiring: which motor is connected where, and which way it turns.
    """

    def __init__(self, inertia: float, wiring: Wiring) -> None:
        self._inertia = inertia
        self._wiring = wiring
        self._speeds = [0.0, 0.0, 0.0, 0.0]
        self._angle, self._rate = 0.0, RESTLESS

    def step(self, state: Any, duties: Any, voltage: float, dt: float) -> None:
        """Go on by `dt` (s), and say so in the state (:data:`sim_backend.physics.state.STATE`).

        Args:
            state: of the drone.
            duties: of the board's outputs (4,), shares of the `voltage` (V).
            voltage: of the battery.
            dt: s.
        """
        momentum = 0.0
        for motor, output in enumerate(self._wiring.output):
            before = self._speeds[motor]
            self._speeds[motor] = _speed_after(before, SPEED_PER_VOLT * float(duties[output]) * voltage, dt)
            change = self._speeds[motor] - before
            momentum += SPINS[motor] * self._wiring.turns[motor] * ROTOR_INERTIA * change
        stiffness = (2.0 * math.pi / PERIOD_S) ** 2
        self._rate -= momentum / self._inertia + dt * stiffness * self._angle
        self._angle += dt * self._rate
        state["position"][2] = HELD_HEIGHT
        state["velocity"] = 0.0
        state["quaternion"] = (0.0, 0.0, math.sin(0.5 * self._angle), math.cos(0.5 * self._angle))
        state["omega"] = (0.0, 0.0, self._rate)
        state["specific_force"] = (0.0, 0.0, GRAVITY)


def _speed_after(speed: float, settled: float, dt: float) -> float:
    """rad/s of a bare rotor that heads for `settled` (rad/s) without friction."""
    driven = max(0.0, settled - speed) / TIME_CONSTANT_S
    return max(0.0, speed + dt * (driven - FRICTION / ROTOR_INERTIA))
