"""Motor commands between the samples of a log."""

from typing import Any

from onboard.mixer import Thrusts
from sim_backend.physics.jit import kernel

HELD = 1e-3
"""s: commands are steps of 2 ms (the controller runs at 500 Hz), logged when they are fresh; a line through
the logged ones is therefore half a step ahead of what the motors were told."""


@kernel
def duty_between(duty: Any, row: int, share: float, dt: float) -> Thrusts:
    """Duties that the motors have at `share` (0..1) of the way from sample `row` to the next.

    They are :data:`HELD` older than a line through the samples.

    Args:
        duty: shape (n, 4), at the samples.
        row, share: when.
        dt: s, sample interval.
    """
    late = share - HELD / dt
    if late < 0.0 and row > 0:
        row, late = row - 1, late + 1.0
    a, b = duty[row], duty[row + 1]
    return (
        a[0] + late * (b[0] - a[0]),
        a[1] + late * (b[1] - a[1]),
        a[2] + late * (b[2] - a[2]),
        a[3] + late * (b[3] - a[3]),
    )
