"""Everything about the sensors of each flight, and the means over flights."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from calibration.flights.flight import PoseSource
from calibration.gap.data.record import FlightRecord, NotUsed
from calibration.gap.sensors.acceleration_fit import AccelerationFit, fit_acceleration
from calibration.gap.sensors.attitude_fit import AttitudeFit, fit_attitude
from calibration.gap.sensors.first_path import first_path
from calibration.gap.sensors.pooling import Pooled, pool
from onboard.arrays import FloatArray

_LEAST_AGREEMENT = 0.3
_TURNING = 0.15  # rad/s rms; below, noise alone may spoil the agreement
_LATEST_S = 0.25


@dataclass(frozen=True)
class FlightSensing:
    """What motion capture and inertial sensors of one flight say of each other, without a vehicle model.

    Attributes:
        attitude: delay, rotation and gyro bias.
        acceleration: offset, accelerometer bias and better rotation; None without accelerometer.
    """

    name: str
    attitude: AttitudeFit
    acceleration: AccelerationFit | None

    @property
    def estimates(self) -> dict[str, tuple[FloatArray, FloatArray]]:
        """Values and their standard errors by effect: ``pose_delay`` (1,), the others (3,)."""
        attitude, acceleration = self.attitude, self.acceleration
        fit = acceleration or attitude
        found = {
            "pose_rotation": (fit.rotation, fit.rotation_covariance),
            "gyro_bias": (attitude.bias, attitude.bias_covariance),
        }
        if acceleration is not None:
            found["pose_offset"] = (acceleration.offset, acceleration.offset_covariance)
        delay = np.array([attitude.delay]), np.array([attitude.delay_error])
        return {"pose_delay": delay, **{name: (x, np.sqrt(np.diag(c))) for name, (x, c) in found.items()}}


def estimate_flights(
    records: Sequence[FlightRecord],
) -> tuple[tuple[FlightSensing, ...], tuple[NotUsed, ...]]:
    """Estimates of all flights whose pose is independent of the gyro, and those with a broken clock."""
    flights, broken = [], []
    for record in records:
        if record.pose_source is PoseSource.ONBOARD_ESTIMATE:
            continue
        start = first_path(record)
        reason = _broken(record, start.agreement, float(np.median(start.delay)))
        if reason is not None:
            broken.append(NotUsed(record.name, reason))
            continue
        attitude = fit_attitude(record, start)
        acceleration = fit_acceleration(record, attitude, attitude.rotation, attitude.rotation_covariance)
        flights.append(FlightSensing(record.name, attitude, acceleration))
    return tuple(flights), tuple(broken)


def pool_flights(flights: Sequence[FlightSensing]) -> dict[str, tuple[Pooled, ...]]:
    """Means over flights by effect, one per parameter; effects with two flights or more."""
    pooled = {}
    for effect in ("pose_delay", "pose_rotation", "pose_offset", "gyro_bias"):
        known = [f.estimates[effect] for f in flights if effect in f.estimates]
        if len(known) >= 2:
            values, errors = (np.array(column) for column in zip(*known, strict=True))
            pooled[effect] = tuple(pool(v, e) for v, e in zip(values.T, errors.T, strict=True))
    return pooled


def _broken(record: FlightRecord, agreement: float, delay: float) -> str | None:
    turning = float(np.sqrt(np.mean(np.sum(record.rate[record.flying] ** 2, axis=1))))
    if turning > _TURNING and agreement < _LEAST_AGREEMENT:
        return (
            "broken clock: tracked attitude and gyro agree at no delay within 0.3 s"
            f" (correlation {agreement:.2f})"
        )
    if abs(delay) > _LATEST_S:
        return f"broken clock: pose and gyro are {delay:.2f} s apart or more"
    return None
