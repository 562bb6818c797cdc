"""Three short flights of a Crazyflie in a calm room of MuJoCo, with what a test hides in it."""

from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from calibration.flights import open_flights
from calibration.gap.data import prepare_flights
from calibration.gap.data.record import FlightRecord
from tests.truth import drawn, paths, pilots
from tests.truth.airframe import Airframe, draw_airframe
from tests.truth.mujoco_room import STEP, Circumstances, Hidden, fly

CALM = Circumstances(
    integrator="RK4", pilot=pilots.GEOMETRIC, ticks=2, per_line=10, phase=3, speed_law=False,
    compensated=True, battery_lag=0.0, accelerometer=True, voltage=True, rest=0.0, gust=0.05,
    pose_noise=1e-4, angle_noise=5e-4,
)  # fmt: skip


def frame() -> Airframe:
    """What flies."""
    return draw_airframe(np.random.default_rng(3), *drawn.CLASSES[0])


@cache
def flights(hidden: Hidden, lab: Circumstances = CALM) -> tuple[FlightRecord, ...]:
    """An eight, quick shakes and climbs, as the gap finder has them: flown once by each process."""
    with TemporaryDirectory() as folder:
        files = []
        for number, kind in enumerate(("eight", "shake", "climbs")):
            goals = paths.draw_path(np.random.default_rng([5, number]), kind, STEP, 14.0, 0.0, 1.0)
            files.append(Path(folder, f"{kind}.csv"))
            drawn.write_log(files[-1], fly(frame(), hidden, lab, goals, np.random.default_rng([7, number])))
        return prepare_flights(open_flights(files)[0]).records
