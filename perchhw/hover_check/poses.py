"""Motion capture during a check: rate, gaps, age, jitter; and what gyro and poses say of each other.

Delay of the poses, turn of the tracked frame and bias of the gyro come from the redundancy of both
(:mod:`calibration.gap.sensors`), without a model of the vehicle. The delay is what nobody reports: poses are
placed at their capture time, gyro samples at the drone's own time, less the 2.8 ms of the gyro's filter.
"""

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from calibration.flights import open_flight
from calibration.gap.data import prepare_flights
from calibration.gap.sensors.flight_estimates import FlightSensing, estimate_flights
from calibration.measurement import Estimate
from onboard.arrays import FloatArray
from perchhw.hover_check.windows import CheckWindows, RecordTooShort

GYRO_FILTER_S = 0.0028
"""Delay of the firmware's 80 Hz filter at low frequency: sqrt(2) / (2 pi 80 Hz)."""
CLOCKS_S = 0.008
"""s, half of what a delay may be off: half a round trip to the room, and the way of a log packet."""


@dataclass(frozen=True)
class Stream:
    """How the poses came.

    Attributes:
        rate: Hz. missing: share of the frames that never came. longest_gap: s without a pose.
        age: s from capture to receipt, median. jitter: s, of the age, from its median to its 95 % quantile.
    """

    rate: Estimate
    missing: Estimate
    longest_gap: Estimate
    age: Estimate
    jitter: Estimate


def stream(windows: CheckWindows) -> Stream:
    """Of the poses of the hover.

    Raises:
        RecordTooShort: there are none.
    """
    t, rows = windows.columns("pose", windows.hover, "frame", "capture_time", "x")
    frames = rows[:, 0]
    expected = frames[-1] - frames[0] + 1.0
    missing = max(0.0, 1.0 - len(frames) / expected)
    ages = t - rows[:, 1]
    count = len(frames)
    middle, late = np.quantile(ages, [0.5, 0.95])
    steps = np.diff(t)
    span = float(t[-1] - t[0])
    return Stream(
        rate=Estimate((count - 1) / span, "Hz", float(steps.std()) / span * (count - 1) / span),
        missing=Estimate(missing, "1", float(np.sqrt(max(missing, 1.0 / expected) / expected))),
        longest_gap=Estimate(float(steps.max()), "s", 0.0),
        age=Estimate(float(middle), "s", _error_of_mean(ages)),
        jitter=Estimate(float(late - middle), "s", _error_of_mean(ages)),
    )


@dataclass(frozen=True)
class SensorAgreement:
    """What poses and inertial sensors say of each other.

    Attributes:
        delay: s, of the poses, beyond what is reported.
        turn: rad about x, y, z of the body, of the tracked frame.
        bias: rad/s about x, y, z, of the gyro.
    """

    delay: Estimate
    turn: tuple[Estimate, Estimate, Estimate]
    bias: tuple[Estimate, Estimate, Estimate]


def sensing(windows: CheckWindows) -> SensorAgreement:
    """Of the whole flight.

    Raises:
        RecordTooShort: the flight cannot be analysed; the message says why.
    """
    found = flight_sensing(windows.run.folder)
    return SensorAgreement(
        delay=unreported_delay(found),
        turn=_three(*found.estimates["pose_rotation"], "rad"),
        bias=_three(*found.estimates["gyro_bias"], "rad/s"),
    )


def unreported_delay(found: FlightSensing) -> Estimate:
    """By how much the poses of a flight are later than their source says, s."""
    sigma = math.hypot(found.attitude.delay_error, CLOCKS_S / math.sqrt(3.0))
    return Estimate(found.attitude.delay + GYRO_FILTER_S, "s", sigma, half_width=CLOCKS_S)


def flight_sensing(record: Path) -> FlightSensing:
    """The estimates of a run folder as they come, errors among them.

    Raises:
        RecordTooShort: as :func:`sensing`.
    """
    prepared = prepare_flights([open_flight(record)])
    flights, broken = estimate_flights(prepared.records)
    if not flights:
        reasons = [one.reason for one in prepared.refused] + [one.reason for one in broken]
        why = "; ".join(reasons) or "poses and gyro cannot be compared"
        raise RecordTooShort(f"{record}: {why}; fly the check again")
    return flights[0]


def _three(values: FloatArray, errors: FloatArray, unit: str) -> tuple[Estimate, Estimate, Estimate]:
    x, y, z = (Estimate(float(v), unit, float(e)) for v, e in zip(values, errors, strict=True))
    return x, y, z


def _error_of_mean(values: FloatArray) -> float:
    return float(values.std() / np.sqrt(len(values)))
