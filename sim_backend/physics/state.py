"""The state of one simulated vehicle as a numpy record; a batch is an array of them.

Units SI; world frame ENU (z up, floor at z = 0), body frame FLU; quaternion scalar-last, body to world.
"""

from enum import IntEnum
from typing import Any

import numpy as np
from numpy.typing import NDArray

COMMAND_MEMORY = 64
"""Steps of commands that a state remembers: a command delay must be shorter."""


class FootMode(IntEnum):
    """What a foot does."""

    FREE = 0
    PRESSING_CEILING = 1
    """touches the ceiling, but has not been pressed hard enough to adhere"""
    PRESSING_FLOOR = 2
    ATTACHED = 3
    RELEASED = 4
    """torn off; may touch again once its rest position is clear of the ceiling"""


STATE = np.dtype(
    [
        ("time", "f8"),  # s since the reset
        ("position", "f8", (3,)),  # m, world, body origin = centre of mass
        ("velocity", "f8", (3,)),  # m/s, world
        ("quaternion", "f8", (4,)),  # x, y, z, w
        ("omega", "f8", (3,)),  # rad/s, body
        ("thrust", "f8", (4,)),  # N, motors M1..M4, after the lag: of the rotor's speed, in still open air
        (
            "rotor_speed",
            "f8",
            (4,),
        ),  # rad/s; kept only with a speed law, valid while it belongs to the thrust
        ("speed_ahead", "f8", (4,)),  # rad/s at the end of the step; kept only within a step, likewise
        ("rotor_acceleration", "f8", (4,)),  # rad/s2, mean over the step; kept only for its torque
        ("coldness", "f8", (4,)),  # 1: has stood for long, 0: a long hover; kept only with motor_warming
        ("command_count", "i8"),  # commands so far; kept only with a command delay
        ("command_memory", "f8", (COMMAND_MEMORY, 4)),  # N, ring of the last commands, one a step
        ("specific_force", "f8", (3,)),  # m/s2, body: mean over the step in the middle of the drone, ideal
        ("charge_used", "f8"),  # C drawn from the full battery
        ("battery_current", "f8"),  # A
        ("battery_voltage", "f8"),  # V at the terminals under load
        ("foot_mode", "i8", (4,)),  # FootMode; legs 1..4 beside motors M1..M4
        ("foot_attached", "i8", (4,)),  # 1 while the foot adheres to the ceiling
        ("foot_refused", "i8", (4,)),  # 1 from a touch too slow to stick until the foot is clear again
        ("foot_impulse", "f8", (4,)),  # N s, of the push on the ceiling since the foot was clear of it
        ("pad_deviate", "f8", (4,)),  # how this landing's pads differ, in standard deviations of their limits
        ("limits_met", "f8", (4,)),  # least speed, push, impulse, cosine that was enough for a pad so far
        ("foot_anchor", "f8", (4, 3)),  # m, world: where a foot that touches is held
        ("body_contact", "i8"),  # 1 once the body or a propeller touched the ceiling (latched)
        (
            "ceiling_contact",
            "i8",
        ),  # 1 once anything touched the ceiling (latched); the impact fields are valid
        ("impact_time", "f8"),  # s, first contact of anything with the ceiling
        ("impact_quaternion", "f8", (4,)),
        ("impact_velocity", "f8", (3,)),  # m/s, world
        ("impact_omega", "f8", (3,)),  # rad/s, body
        ("body_contact_time", "f8"),  # s, first contact of the body or a propeller with the ceiling
    ],
    align=True,
)


def new_states(count: int) -> NDArray[np.void]:
    """`count` vehicles at the origin: level, at rest, legs free, motors still and warm, no battery yet."""
    states = np.zeros(count, dtype=STATE)
    states["quaternion"][:, 3] = 1.0
    states["impact_quaternion"][:, 3] = 1.0
    states["impact_time"] = np.inf
    states["body_contact_time"] = np.inf
    states["limits_met"] = np.inf
    return states


def new_state() -> Any:
    """One vehicle as in :func:`new_states`, as a record that the kernels change in place."""
    return new_states(1)[0]
