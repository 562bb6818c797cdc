"""Records as ideal sensors would have given them."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from scipy.interpolate import CubicSpline

from calibration.gap.data.kinematics import differentiate, pose_at
from calibration.gap.data.record import FlightRecord
from calibration.gap.data.rotations import matrices, turned
from calibration.gap.sensors.acceleration_fit import fit_acceleration
from calibration.gap.sensors.flight_estimates import FlightSensing
from calibration.gap.sensors.knots import hats
from calibration.gap.sensors.pooling import Pooled
from onboard.arrays import BoolArray, FloatArray

_TIGHT = 1e-5  # rad: a rotation that is taken as known
_STEADY_S = 1e-4  # a path that wanders less is a constant


def best_values(flight: FlightSensing, pooled: Mapping[str, Sequence[Pooled]]) -> dict[str, FloatArray]:
    """The flight's parameters by effect, each drawn towards the mean over flights as its error is large."""
    best = {}
    for name, (values, errors) in flight.estimates.items():
        if name in pooled:
            means = zip(pooled[name], values, errors, strict=True)
            best[name] = np.array([p.shrunk(value, error) for p, value, error in means])
        else:
            best[name] = values
    return best


def correct_flight(
    record: FlightRecord, flight: FlightSensing, pooled: Mapping[str, Sequence[Pooled]]
) -> FlightRecord:
    """The record on one clock, body frame and origin those of the inertial sensors, biases removed.

    The attitude is that of gyro and tracking together, which has the noise of neither.
    """
    best = best_values(flight, pooled)
    aligned = align(record, flight, best)
    fit = flight.attitude
    attitude = turned(turned(fit.attitude, fit.rotation), -best["pose_rotation"])
    attitude = _interpolated(record.t, attitude, _onboard_times(record, flight))
    attitude /= np.linalg.norm(attitude, axis=1, keepdims=True)
    late, wander = 1e3 * best["pose_delay"][0], 1e3 * float(fit.path.std())
    notes = [
        f"pose late by {late:.1f} ms, wandering by {wander:.1f} ms: corrected",
        f"tracked frame turned by {_listed(np.degrees(best['pose_rotation']))} deg: aligned",
    ]
    specific_force = aligned.specific_force
    refit = fit_acceleration(record, fit, best["pose_rotation"], _TIGHT**2 * np.eye(3))
    if specific_force is not None and refit is not None:
        specific_force = specific_force - refit.bias
        notes.append(f"accelerometer bias {_listed(refit.bias)} m/s2: removed")
    return replace(
        aligned,
        velocity=differentiate(aligned.position, record.dt),
        attitude=attitude,
        specific_force=specific_force,
        notes=(*record.notes, *notes),
    )


def align(record: FlightRecord, flight: FlightSensing, values: Mapping[str, FloatArray]) -> FlightRecord:
    """The record without the sensing effects of which `values` are the parameters; attitude as tracked.

    The mean delay shifts the pose. What wanders about it is put to the onboard channels: in public flights
    the tracking ticks evenly and the times at which packets came do not, and a pose that is moved unevenly
    has no velocity. The velocity of the result is not up to date.
    """
    position, attitude, known = pose_at(record, record.t + values["pose_delay"][0])
    attitude = turned(attitude, -values["pose_rotation"])
    if "pose_offset" in values:
        position = position - matrices(attitude) @ values["pose_offset"]
    at = _onboard_times(record, flight)
    voltage, force = record.voltage, record.specific_force
    return replace(
        record,
        position=position,
        attitude=attitude,
        rate=_interpolated(record.t, record.rate, at) - values["gyro_bias"],
        specific_force=None if force is None else _interpolated(record.t, force, at),
        duty=np.column_stack([np.interp(at, record.t, duty) for duty in record.duty.T]),
        voltage=None if voltage is None else np.interp(at, record.t, voltage),
        flying=_at_both_sides(record, record.flying, at),
        motors_known=_at_both_sides(record, record.motors_known, at),
        inertial_known=_at_both_sides(record, record.inertial_known, at),
        resting=_at_both_sides(record, record.resting, at),
        pose_known=known,
    )


def _onboard_times(record: FlightRecord, flight: FlightSensing) -> FloatArray:
    """Times (s), shape (n,), in the log's onboard channels of what happened at the record's times."""
    fit = flight.attitude
    wander = hats(record.t, fit.knots) @ fit.path - fit.delay
    if np.max(np.abs(wander)) < _STEADY_S:
        return record.t
    return np.interp(record.t, np.maximum.accumulate(record.t + wander), record.t)


def _interpolated(t: FloatArray, values: FloatArray, at: FloatArray) -> FloatArray:
    if at is t:
        return values.copy()
    return np.asarray(CubicSpline(t, values)(at))


def _at_both_sides(record: FlightRecord, mask: BoolArray, at: FloatArray) -> BoolArray:
    """Whether `mask` holds at the samples before and after the times `at`."""
    if at is record.t:
        return mask
    place = (at - record.t[0]) / record.dt
    last = record.t.size - 1
    before = np.clip(np.floor(place + 1e-6).astype(np.int64), 0, last)
    after = np.clip(np.ceil(place - 1e-6).astype(np.int64), 0, last)
    return np.asarray(mask[before] & mask[after])


def _listed(values: FloatArray) -> str:
    return "(" + ", ".join(f"{v:.2f}" for v in values) + ")"
