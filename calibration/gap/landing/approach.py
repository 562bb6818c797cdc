"""The approach: velocity that was asked for, against the one that was flown, at the trigger."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from calibration.flights import Flight
from calibration.gap.landing.segments import LandingSegment

WINDOW = 0.1
"""s before the trigger over which measured velocities are averaged."""


@dataclass(frozen=True)
class ApproachResidual:
    """Measured minus commanded velocity at the trigger (m/s), along x and z of the world.

    Attributes:
        flights: that know both. mean_x, sd_x, mean_z, sd_z: m/s over them.
    """

    flights: tuple[str, ...]
    mean_x: float
    sd_x: float
    mean_z: float
    sd_z: float


def approach_residual(landings: Sequence[LandingSegment]) -> ApproachResidual | None:
    """Over the flights that know what was asked for; None when there is none."""
    names, errors = [], []
    for landing in landings:
        asked, flown = _asked(landing.flight, landing.trigger), _flown(landing)
        if asked is not None and flown is not None:
            names.append(landing.name)
            errors.append((flown[0] - asked[0], flown[1] - asked[1]))
    if not names:
        return None
    values = np.array(errors)
    mean, sd = values.mean(axis=0), values.std(axis=0, ddof=1 if len(values) > 1 else 0)
    return ApproachResidual(tuple(names), float(mean[0]), float(sd[0]), float(mean[1]), float(sd[1]))


def _asked(flight: Flight, trigger: float) -> tuple[float, float] | None:
    """Commanded velocity (x, z): of the attempt where it is known, else the setpoint's at the trigger."""
    if flight.commanded_speed is not None and flight.commanded_angle_deg is not None:
        angle = math.radians(flight.commanded_angle_deg)
        return flight.commanded_speed * math.cos(angle), flight.commanded_speed * math.sin(angle)
    if not flight.has("setpoint_vx", "setpoint_vz"):
        return None
    t, values = flight.series("setpoint_vx", "setpoint_vz")
    before = np.flatnonzero(t <= trigger)
    return (float(values[before[-1], 0]), float(values[before[-1], 1])) if before.size else None


def _flown(landing: LandingSegment) -> tuple[float, float] | None:
    """Measured velocity (x, z): the onboard snapshot where there is one, else from poses before the flip."""
    trigger = landing.flight.trigger
    if trigger is not None and {"vx", "vz"} <= trigger.snapshot.keys():
        return trigger.snapshot["vx"], trigger.snapshot["vz"]
    rows = (landing.pose_t > landing.trigger - WINDOW) & (landing.pose_t <= landing.trigger)
    if np.count_nonzero(rows) < 3:
        return None
    slope = np.polyfit(landing.pose_t[rows], landing.pose[rows, 4:7], 1)[0]
    return float(slope[0]), float(slope[2])
