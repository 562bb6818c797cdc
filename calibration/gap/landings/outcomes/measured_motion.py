"""What a flight's log says of its landing: its own samples, by the trigger's clock, where they count."""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.transform import Rotation

from calibration.gap.data.rotations import integrate_rate
from calibration.gap.landings.outcomes.prepare import PreparedLandings
from calibration.gap.landings.outcomes.simulated_motion import flip_angles
from calibration.gap.landings.outcomes.starts import TriggerStart
from calibration.gap.landings.segments import commanded_thrusts, motion_of
from onboard.arrays import BoolArray, FloatArray
from onboard.vehicle import Vehicle

BEFORE = 0.1
"""s before the trigger from which samples are kept."""

_SAME = 1e-9  # s, times that differ by rounding alone
_STEP = 1e-3  # s, of the gyro's integral
_AT_RANGE = 0.995  # of a gyro's range: it may have turned faster
_LEAST_AFTER_CONTACT = 0.3  # s of gyro after the contact; a record that ends before is called short


@dataclass(frozen=True)
class MeasuredMotion:
    """Samples of one flight from shortly before its trigger on; times in s after the trigger.

    Attributes:
        clock: s, by which the log's times were moved. clock_known: whether that could be told.
        contact: first contact; None: unseen. contact_error: s, half of what lies between the gyro samples
            around it.
        gyro_t, gyro: (k,) and rad/s (k, 3); NaN at the gyro's range.
        pose_t, pose: (m,), and quaternion with position (m) in the world, (m, 7), while they can be trusted.
        thrust_t, thrust: (j,) and N (j, 4), as commanded.
        turned_t, turned: (i,) and attitudes (i, 4) by the gyro from the trigger on, until the contact.
        left_out: what the log lacks, or has and is not shown, in words.
    """

    clock: float
    clock_known: bool
    contact: float | None
    contact_error: float
    gyro_t: FloatArray
    gyro: FloatArray
    pose_t: FloatArray
    pose: FloatArray
    thrust_t: FloatArray
    thrust: FloatArray
    turned_t: FloatArray
    turned: FloatArray
    left_out: tuple[str, ...]

    @property
    def pose_flip_angles(self) -> FloatArray:
        """Flip angles (rad, (m,)) by the poses."""
        return flip_angles(self.pose[:, :4])

    @property
    def turned_flip_angles(self) -> FloatArray:
        """Flip angles (rad, (i,)) by the gyro."""
        return flip_angles(self.turned)


def measured_motion(
    prepared: PreparedLandings, index: int, vehicle: Vehicle, horizon: float
) -> MeasuredMotion:
    """Samples of one flight.

    Args:
        prepared: the flights. index: which of them.
        vehicle: for thrusts of PWM, and the gyro's range.
        horizon: s after the trigger until which samples are kept.
    """
    start, flip = prepared.starts[index], prepared.flips[index]
    motion, trigger = motion_of(start.flight), start.flight.trigger
    if motion is None or trigger is None:
        raise ValueError(f"{start.name} has no start: it lacks gyro, pose or trigger")
    late = flip.clock - trigger.t
    contact = prepared.contact(index)
    rows = _within(motion.t + late, horizon)
    gyro_t, gyro = motion.t[rows] + late, motion.rates[rows].copy()
    gyro[np.abs(gyro) >= _AT_RANGE * vehicle.sensing.gyro_range.value] = np.nan
    # An onboard estimate is trusted up to the flip only: the filter fails during some of them.
    posed = _within(motion.pose_t + late, horizon if start.tracked else flip.clock + _SAME)
    thrust_t, thrust = commanded_thrusts(start.flight, vehicle) or (np.empty(0), np.empty((0, 4)))
    told = _within(thrust_t + late, horizon)
    last = np.inf if contact is None else contact - start.contact_error
    turned_t, turned = _turned(start, gyro_t, gyro, last, contact)
    found = MeasuredMotion(
        clock=flip.clock,
        clock_known=not flip.clock_at_bound,
        contact=contact,
        contact_error=start.contact_error,
        gyro_t=gyro_t,
        gyro=gyro,
        pose_t=motion.pose_t[posed] + late,
        pose=motion.pose[posed],
        thrust_t=thrust_t[told] + late,
        thrust=thrust[told],
        turned_t=turned_t,
        turned=turned,
        left_out=(),
    )
    return replace(found, left_out=tuple(_left_out(found, start.tracked)))


def _within(t: FloatArray, horizon: float) -> BoolArray:
    return (t >= -BEFORE) & (t <= horizon)


def _turned(
    start: TriggerStart, t: FloatArray, gyro: FloatArray, last: float, contact: float | None
) -> tuple[FloatArray, FloatArray]:
    """Times (i,) and attitudes (i, 4) by the gyro from the start's, without samples after `last` (s).

    Between the last sample and the contact the rate is taken as it was.
    """
    unknown = np.flatnonzero((t > 0.0) & ~np.isfinite(gyro).all(axis=1))
    rows = (t <= last) & np.isfinite(gyro).all(axis=1)
    if unknown.size:
        rows &= t < t[unknown[0]]
    if not rows.any():
        return np.zeros(1), start.state["quaternion"][:1].copy()
    end = t[rows][-1] if contact is None or unknown.size else contact
    fine = np.arange(0.0, max(end, 0.0) + 0.5 * _STEP, _STEP)
    rates = np.column_stack([np.interp(fine, t[rows], gyro[rows, axis]) for axis in range(3)])
    turn = Rotation.from_quat(integrate_rate(rates, _STEP))
    return fine, np.asarray((Rotation.from_quat(start.state["quaternion"][0]) * turn).as_quat())


def _left_out(found: MeasuredMotion, tracked: bool) -> Iterator[str]:
    """What a reader might look for in vain, and why."""
    if not found.clock_known:
        yield "the log's clock (the flip is too far beside its trigger), and with it the time of the contact"
    if not tracked:
        yield "poses after the trigger (an onboard estimate fails in flips)"
    at_range = np.count_nonzero(np.isnan(found.gyro).any(axis=1))
    if at_range:
        yield f"{at_range} sample{'s' if at_range > 1 else ''} of the gyro at its range"
    if found.contact is None:
        yield "the first contact (the gyro shows none)"
    end = float(found.gyro_t[-1]) if found.gyro_t.size else 0.0
    if end < (found.contact or 0.0) + _LEAST_AFTER_CONTACT:
        yield f"the motion from {end:.2f} s on (the record ends there)"
    if not np.any(found.thrust_t > found.clock + _SAME):
        yield "motor commands after the trigger (not logged)"
