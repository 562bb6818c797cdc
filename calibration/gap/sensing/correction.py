"""Records as ideal sensors would have given them."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from calibration.gap.prepare.velocity import differentiate
from calibration.gap.record import FlightRecord
from calibration.gap.sensing.acceleration import fit_acceleration
from calibration.gap.sensing.flight_estimates import FlightSensing
from calibration.gap.sensing.knots import hats
from calibration.gap.sensing.pooling import Pooled
from calibration.gap.sensing.resample_pose import pose_at
from calibration.gap.sensing.rotations import matrices, turned
from onboard.arrays import FloatArray

_TIGHT = 1e-5  # rad: a rotation that is taken as known


def correct_flight(
    record: FlightRecord, flight: FlightSensing, pooled: Mapping[str, Sequence[Pooled]]
) -> FlightRecord:
    """The record on the onboard clock, body frame aligned, origin at the accelerometer, biases removed.

    Each value is that of the flight, drawn towards the mean over flights as far as its own error is large.
    The attitude is that of gyro and tracking together, which follows the onboard clock within a packet.
    """
    best = {
        name: np.array(
            [p.shrunk(v, e) for p, v, e in zip(pooled[name], values, flight.errors[name], strict=True)]
        )
        if name in pooled
        else values
        for name, values in flight.values.items()
    }
    fit = flight.attitude
    path = hats(record.t, fit.knots) @ fit.path + (best["pose_delay"][0] - fit.delay)
    position, _, known = pose_at(record, record.t + path)
    attitude = turned(turned(fit.attitude, fit.rotation), -best["pose_rotation"])
    specific_force = record.specific_force
    notes = [
        f"pose late by {best['pose_delay'][0] * 1e3:.1f} ms (path {np.std(path) * 1e3:.1f} ms): corrected"
    ]
    if specific_force is not None and "pose_offset" in best:
        position = position - matrices(attitude) @ best["pose_offset"]
        refit = fit_acceleration(record, fit, best["pose_rotation"], _TIGHT**2 * np.eye(3))
        if refit is not None:
            specific_force = specific_force - refit.bias
            notes.append(f"accelerometer bias {_listed(refit.bias)} m/s2: removed")
    notes.append(f"tracked frame turned by {_listed(np.degrees(best['pose_rotation']))} deg: aligned")
    return replace(
        record,
        position=position,
        velocity=differentiate(position, record.dt),
        attitude=attitude,
        rate=record.rate - best["gyro_bias"],
        specific_force=specific_force,
        pose_known=known,
        notes=(*record.notes, *notes),
    )


def without_effect(record: FlightRecord, effect: str, values: FloatArray) -> FlightRecord:
    """The record without one sensing effect, of which `values` are the parameters: its inverse.

    pose_delay (s), pose_rotation (rad), pose_offset (m) or gyro_bias (rad/s).
    """
    if effect == "pose_delay":
        position, attitude, known = pose_at(record, record.t + values[0])
        return replace(record, position=position, attitude=attitude, pose_known=known)
    if effect == "pose_rotation":
        return replace(record, attitude=turned(record.attitude, -values))
    if effect == "pose_offset":
        return replace(record, position=record.position - matrices(record.attitude) @ values)
    return replace(record, rate=record.rate - values)


def _listed(values: FloatArray) -> str:
    return "(" + ", ".join(f"{v:.2f}" for v in values) + ")"
