"""Make the record of a flight, or say why it cannot be used."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from calibration.flights import Flight, UnusableFlight, UnusableFlightError
from calibration.gap.data.duplicates import duplicate_of
from calibration.gap.data.kinematics import continuous_quaternions, differentiate
from calibration.gap.data.known_time import check_known
from calibration.gap.data.limitations import limitations
from calibration.gap.data.logged import LoggedSignals, read_signals
from calibration.gap.data.names import distinctly_named
from calibration.gap.data.phases import LEAST_FLYING_S, free_flight, resting
from calibration.gap.data.plausible import ConventionError, check_plausible, check_upright
from calibration.gap.data.record import FlightRecord
from calibration.gap.data.samples import grid_interval, resample, uniform_grid
from calibration.gap.data.shapes import kinds_of
from onboard.battery import FULL_RATIO


@dataclass(frozen=True)
class PreparedFlights:
    """Flights that can be analysed.

    Attributes:
        limitations: what cannot be concluded from these flights, in words.
    """

    records: tuple[FlightRecord, ...]
    refused: tuple[UnusableFlight, ...]
    limitations: tuple[str, ...]


def prepare_flights(flights: Sequence[Flight]) -> PreparedFlights:
    """Records of all flights that can be used; the others with the reason.

    Nothing that a sensing effect explains is corrected here (clock between pose and gyro, turned or shifted
    frame, biases): that is for :mod:`calibration.gap.sensors` to find and to correct.
    """
    records, refused, readable = [], [], []
    flights = distinctly_named(flights)
    copies = duplicate_of(flights)
    for flight, copied in zip(flights, copies, strict=True):
        if copied is not None:
            refused.append(
                UnusableFlight(flight.source, f"holds the same numbers as {copied.source}, or nearly")
            )
            continue
        try:
            readable.append((flight, read_signals(flight)))
        except UnusableFlightError as error:
            refused.append(UnusableFlight(error.source, error.reason))
    # One interval for all flights, or their noise and their lags would be of different kinds.
    intervals = [grid_interval(s.pose, s.gyro.samples) for _, s in readable]
    otherwise = []
    for flight, signals in readable:
        try:
            record = _record(flight, signals, float(np.median(intervals)))
            check_plausible(flight, record)
            check_known(flight, record)
            records.append(record)
        except ConventionError as error:
            otherwise.append(UnusableFlight(error.source, error.reason))
        except UnusableFlightError as error:
            refused.append(UnusableFlight(error.source, error.reason))
    refused += otherwise
    if len(otherwise) > len(records):  # one program wrote them all: the others move too little to tell
        refused += [_as_most(record, otherwise) for record in records]
        records = []
    kinds = kinds_of(records).tolist()
    records = [replace(record, shape=f"kind {kind:03d}") for record, kind in zip(records, kinds, strict=True)]
    return PreparedFlights(tuple(records), tuple(refused), limitations(records))


def _as_most(record: FlightRecord, otherwise: Sequence[UnusableFlight]) -> UnusableFlight:
    """A flight beside more that are in another unit or frame."""
    return UnusableFlight(
        record.source,
        f"{len(otherwise)} others were refused ({otherwise[0].reason}), and this one moves too little "
        "to tell whether it is different: convert all of them",
    )


def _record(flight: Flight, signals: LoggedSignals, interval: float) -> FlightRecord:
    """The record of one flight, with samples `interval` (s) apart.

    Raises:
        UnusableFlightError: it cannot be used; names the reason.
    """
    t = uniform_grid(interval, signals.pose, signals.motors.samples, signals.gyro.samples)
    if t.size < 2 or t[-1] - t[0] < LEAST_FLYING_S:
        raise UnusableFlightError(flight.source, "pose, gyro and motor commands do not overlap in time")
    poses, pose_known = resample(signals.pose, t)
    check_upright(flight, poses[:, 3:])
    rate, inertial_known = resample(signals.gyro.samples, t)
    pwm, motors_known = resample(signals.motors.samples, t)
    specific_force = None
    if signals.accelerometer is not None:
        specific_force, known = resample(signals.accelerometer.samples, t)
        inertial_known &= known
    rest = resting(t, pwm, rate, poses[:, :3])
    return FlightRecord(
        name=flight.name,
        source=flight.source,
        shape="",
        t=t,
        position=poses[:, :3],
        velocity=differentiate(poses[:, :3], float((t[-1] - t[0]) / (t.size - 1))),
        attitude=continuous_quaternions(poses[:, 3:]),
        rate=rate,
        specific_force=specific_force,
        duty=pwm / FULL_RATIO,
        voltage=None if signals.battery is None else resample(signals.battery, t)[0][:, 0],
        flying=free_flight(flight, t, pwm, poses[:, :3], rest),
        motors_known=motors_known,
        pose_known=pose_known,
        inertial_known=inertial_known,
        resting=rest,
        pose_source=flight.pose_source,
        ceiling_z=flight.ceiling_z,
        notes=(*flight.notes, *signals.notes),
    )
