"""How far starts and flips scatter about what was recorded, and approaches about what they were told.

All of it is estimated from the flights themselves; those far outside the others do not widen the rest.

Two sources of one number differ by the errors of both; taken as alike, each has 1/sqrt(2) of the difference.
The distance to the ceiling scatters as the ceilings do that the contacts imply, less what the time between
two gyro samples makes of it. Flips scatter as the slopes of measured over predicted rates do.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from calibration.gap.landings.outcomes.starts import TriggerStart
from onboard.arrays import FloatArray

LEAST = 5
"""Flights that a standard deviation needs."""

_NORMAL = 1.4826  # standard deviation of a normal distribution over its median absolute deviation

_SANE = 4.0

Vector = tuple[float, float, float]


@dataclass(frozen=True)
class Dispersion:
    """Standard deviations of what differs from the recorded start.

    Attributes:
        height: m, distance to the ceiling.
        velocity: m/s, world. attitude: rad, body. rate: rad/s, body.
        pitch: share of the flip's pitch acceleration. roll: roll acceleration per pitch acceleration.
    """

    height: float
    velocity: Vector
    attitude: Vector
    rate: Vector
    pitch: float
    roll: float


UNKNOWN = Dispersion(0.01, (0.03, 0.03, 0.03), (0.01, 0.01, 0.01), (0.15, 0.15, 0.15), 0.03, 0.03)
"""Of a start that is known from motion capture (``start_state``), where flights are too few to tell."""


def estimate_dispersion(
    starts: Sequence[TriggerStart],
    ceilings: FloatArray,
    speeds: FloatArray,
    pitch_slopes: FloatArray,
    roll_slopes: FloatArray,
) -> Dispersion:
    """Standard deviations over flights.

    Args:
        starts: all flights.
        ceilings: m (n,), height that each contact implies, less that of its session; NaN where unseen, or
            where nobody knows that of the session: what a drone reckoned is off by more than flights scatter.
        speeds: m/s (n,), climb of the highest point at the contact.
        pitch_slopes, roll_slopes: as of :class:`..prepare.PreparedLandings`.
    """
    wait = np.array([start.contact_error for start in starts])
    unseen = np.abs(speeds) * wait / np.sqrt(3.0)  # uniform between the samples
    known = np.isfinite(ceilings)
    height = UNKNOWN.height
    if np.count_nonzero(known) >= LEAST:
        height = float(
            np.sqrt(max(standard_deviation(ceilings) ** 2 - float(np.mean(unseen[known] ** 2)), 1e-6))
        )
    velocities = [s.redundant.velocity for s in starts if s.redundant.velocity is not None]
    return Dispersion(
        height=height,
        velocity=_half(np.array(velocities), UNKNOWN.velocity),
        attitude=_half(np.array([s.redundant.attitude for s in starts]), UNKNOWN.attitude),
        rate=_half(np.array([s.redundant.rate for s in starts]), UNKNOWN.rate),
        pitch=_or(pitch_slopes, UNKNOWN.pitch),
        roll=_or(roll_slopes, UNKNOWN.roll),
    )


def _half(differences: FloatArray, unknown: Vector) -> Vector:
    """Standard deviation of one of two sources that differ by `differences` (n, 3)."""
    if len(differences) < LEAST:
        return unknown
    x, y, z = (_or(differences[:, axis] / np.sqrt(2.0), unknown[axis]) for axis in range(3))
    return x, y, z


def _or(values: FloatArray, unknown: float) -> float:
    return standard_deviation(values) if np.count_nonzero(np.isfinite(values)) >= LEAST else unknown


def standard_deviation(values: FloatArray) -> float:
    """Standard deviation of what lies within _SANE robust ones: a log that jumps once must not widen all."""
    known = values[np.isfinite(values)]
    off = np.abs(known - np.median(known))
    return float(np.std(known[off <= _SANE * _NORMAL * np.median(off)]))


@dataclass(frozen=True)
class MeasuredLaunch:
    """Of the flights with a trigger and a commanded approach.

    Attributes:
        reached_x, reached_z: median share of the commanded velocity at the trigger.
        spread_x, spread_y, spread_z: m/s, standard deviations about that.
        ceiling: m, mean height of the ceiling above where the drone reckoned it; None where nobody knows it.
        ceiling_spread: m, standard deviation of it, between sessions and within; None likewise.
        sessions, ceiling_flights: how many these two are from.
    """

    flights: int
    reached_x: float
    reached_z: float
    spread_x: float
    spread_y: float
    spread_z: float
    ceiling: float | None
    ceiling_spread: float | None
    sessions: int
    ceiling_flights: int


def measured_launch(
    starts: Sequence[TriggerStart], ceilings: FloatArray, height: float
) -> MeasuredLaunch | None:
    """From starts; None where fewer than five were told a speed and an angle.

    Args:
        ceilings: m (n,), of the sessions of the flights; NaN where nobody knows it.
        height: m, standard deviation of the distance to the ceiling within a session.
    """
    told, flown, above, sessions = [], [], [], set()
    for start, ceiling in zip(starts, ceilings, strict=True):
        speed, angle = start.flight.commanded_speed, start.flight.commanded_angle_deg
        if speed is not None and angle is not None:
            told.append([speed * np.cos(np.radians(angle)), speed * np.sin(np.radians(angle))])
            flown.append(start.state["velocity"][0])
            if np.isfinite(ceiling):
                above.append(ceiling - start.reckoned_ceiling)
                sessions.add(start.flight.session)
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
        ceiling=float(np.mean(above)) if above else None,
        ceiling_spread=float(np.hypot(np.std(above), height)) if above else None,
        sessions=len(sessions),
        ceiling_flights=len(above),
    )
