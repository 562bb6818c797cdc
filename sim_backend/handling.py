"""What people do to a simulated drone: wire its motors wrong, put a wrong propeller on, hold it in a hand."""

import math
from typing import Any, NamedTuple

from onboard.arrays import FloatArray, Quaternion
from onboard.gravity import GRAVITY
from sim_backend.fault_values import Window
from sim_backend.lab_faults import DroneFaults

HELD_HEIGHT = 1.0
"""m above the floor."""
_HALF = math.radians(15.0)
_NOSE_DOWN: Quaternion = (0.0, math.sin(_HALF), 0.0, math.cos(_HALF))
_LEFT_SIDE_DOWN: Quaternion = (-math.sin(_HALF), 0.0, 0.0, math.cos(_HALF))


class Wiring(NamedTuple):
    """Which output of the board each motor is connected to (index), the share of it that lifts, and which way
    the motor turns: 1 its own, -1 the other."""

    output: tuple[int, int, int, int]
    lifts: tuple[float, float, float, float]
    turns: tuple[int, int, int, int]

    def delivered(self, duties: FloatArray) -> FloatArray:
        """What motors 1 to 4 make of the board's `duties`, both (4,)."""
        return duties[list(self.output)] * self.lifts


WIRED = Wiring((0, 1, 2, 3), (1.0, 1.0, 1.0, 1.0), (1, 1, 1, 1))
"""As it should be."""


def wiring_of(faults: DroneFaults) -> Wiring:
    """The wiring of a drone with these faults; :data:`WIRED` itself where there are none."""
    output, lifts, turns = list(WIRED.output), list(WIRED.lifts), list(WIRED.turns)
    if faults.motors_swapped is not None:
        a, b = (motor - 1 for motor in faults.motors_swapped)
        output[a], output[b] = output[b], output[a]
    if faults.propeller_reversed:
        lifts[faults.propeller_reversed - 1] = 0.0
    if faults.motor_reversed:
        lifts[faults.motor_reversed - 1] = 0.0
        turns[faults.motor_reversed - 1] = -1
    wiring = Wiring(
        (output[0], output[1], output[2], output[3]),
        (lifts[0], lifts[1], lifts[2], lifts[3]),
        (turns[0], turns[1], turns[2], turns[3]),
    )
    return WIRED if wiring == WIRED else wiring


def attitude_in_hand(held: Window, time: float) -> Quaternion | None:
    """How a person holds a drone at `time` (s): nose down, then left side down; None: it is not held."""
    if not held.covers(time):
        return None
    return _NOSE_DOWN if time - held.start < 0.5 * (held.end - held.start) else _LEFT_SIDE_DOWN


def hold_in_hand(state: Any, attitude: Quaternion) -> None:
    """Make the state (:data:`sim_backend.physics.state.STATE`) that of a drone that is held still."""
    x, y, z, w = attitude
    state["position"][2] = HELD_HEIGHT
    state["quaternion"] = attitude
    state["velocity"] = 0.0
    state["omega"] = 0.0
    state["specific_force"] = (
        2.0 * GRAVITY * (x * z - w * y),
        2.0 * GRAVITY * (y * z + w * x),
        GRAVITY * (1.0 - 2.0 * (x * x + y * y)),
    )
