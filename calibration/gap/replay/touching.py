"""Where a vehicle came so near the floor, hull or propellers, that it may have touched it: no free flight.

What stands first shows how high that is. A log that begins in the air does not, and a vehicle that leans
touches earlier than a level one. Its file says how large it is; the floor of the physics is at z = 0.
"""

import dataclasses
from collections.abc import Sequence
from typing import Any

import numpy as np

from calibration.gap.data.phases import CONTACT_MARGIN_S, near
from calibration.gap.data.record import FlightRecord
from calibration.gap.replay.inputs import below_no_ceiling
from onboard.arrays import BoolArray, FloatArray
from onboard.vehicle import Vehicle
from sim_backend.physics.collision import touches
from sim_backend.physics.jit import outlined
from sim_backend.physics.state import new_state
from sim_backend.physics.step import attitude

_GAP = 0.005
"""m above the floor: a pose that is measured every few milliseconds misses the lowest point by as much."""

_FLOOR = 1.0
"""Direction of its normal along z."""


def clear_of_floor(records: Sequence[FlightRecord], vehicle: Vehicle) -> list[FlightRecord]:
    """The flights, in the air only where the vehicle is clear of the floor.

    One that would be on it all the time counts its height from somewhere else, and stays as it is.
    """
    p = below_no_ceiling(vehicle)
    return [_clear(record, p) for record in records]


def _clear(record: FlightRecord, p: Any) -> FlightRecord:
    if record.resting.any():
        return record
    touched = np.zeros(record.t.size, dtype=np.bool_)
    _touched(new_state(), p, np.nan_to_num(record.position), np.nan_to_num(record.attitude), touched)
    in_the_air = record.flying & ~near(record.t, record.t[touched & record.flying], CONTACT_MARGIN_S)
    return dataclasses.replace(record, flying=in_the_air) if in_the_air.any() else record


@outlined
def _touched(state: Any, p: Any, position: FloatArray, quaternion: FloatArray, out: BoolArray) -> None:
    for k in range(out.size):
        state.position[2] = position[k, 2] - _GAP
        for index in range(4):
            state.quaternion[index] = quaternion[k, index]
        out[k] = touches(state, p, attitude(state), _FLOOR)
