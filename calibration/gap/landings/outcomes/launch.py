"""How real approaches differ from what they were told: what a simulated attempt must scatter by.

Velocity at the trigger over the commanded one, and the ceiling against where the drone reckoned it; how flips
scatter is in :mod:`..dispersion`. Flights that lie far outside the others do not widen the rest.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from calibration.gap.landings.outcomes.dispersion import LEAST, standard_deviation
from calibration.gap.landings.outcomes.starts import TriggerStart
from onboard.arrays import FloatArray


@dataclass(frozen=True)
class MeasuredLaunch:
    """Of the flights with a trigger and a commanded approach.

    Attributes:
        reached_x, reached_z: median share of the commanded velocity at the trigger.
        spread_x, spread_y, spread_z: m/s, standard deviations about that.
        ceiling: m, mean height of the ceiling above where the drone reckoned it.
        ceiling_spread: m, standard deviation of it, between sessions and within.
    """

    flights: int
    reached_x: float
    reached_z: float
    spread_x: float
    spread_y: float
    spread_z: float
    ceiling: float
    ceiling_spread: float


def measured_launch(
    starts: Sequence[TriggerStart], ceilings: FloatArray, height: float
) -> MeasuredLaunch | None:
    """From starts; None where fewer than five were told a speed and an angle.

    Args:
        ceilings: m (n,), of the sessions of the flights.
        height: m, standard deviation of the distance to the ceiling within a session.
    """
    told, flown, above = [], [], []
    for start, ceiling in zip(starts, ceilings, strict=True):
        speed, angle = start.flight.commanded_speed, start.flight.commanded_angle_deg
        if speed is not None and angle is not None:
            told.append([speed * np.cos(np.radians(angle)), speed * np.sin(np.radians(angle))])
            flown.append(start.state["velocity"][0])
            above.append(ceiling - start.reckoned_ceiling)
    if len(told) < LEAST:
        return None
    asked, reached = np.array(told), np.array(flown)
    share_x, share_z = (float(np.median(reached[:, axis] / asked[:, k])) for k, axis in ((0, 0), (1, 2)))
    return MeasuredLaunch(
        flights=len(told),
        reached_x=share_x,
        reached_z=share_z,
        spread_x=standard_deviation(reached[:, 0] - share_x * asked[:, 0]),
        spread_y=standard_deviation(reached[:, 1]),
        spread_z=standard_deviation(reached[:, 2] - share_z * asked[:, 1]),
        ceiling=float(np.mean(above)),
        ceiling_spread=float(np.hypot(np.std(above), height)),
    )
