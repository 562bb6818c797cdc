"""Landings in flights: when something first touched the ceiling; what was seen and commanded around it."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from calibration.flights import Flight, PoseSource
from calibration.gap.data.kinematics import continuous_quaternions
from calibration.gap.data.record import NotUsed
from calibration.gap.data.samples import samples_of
from calibration.gap.landings.kernels import DT
from onboard.arrays import FloatArray
from onboard.battery import FULL_RATIO, thrust_from_voltage
from onboard.vehicle import Vehicle

JUMP = 4.0
"""rad/s: a rate that departs this far from its own straight line within a sample has met something. A flip
bends by 1 rad/s in 20 ms; a foot that meets the ceiling at 1 m/s changes the rate by 10."""

STRAIGHT = 0.06
"""s of samples that the straight line goes through: times of arrival over the radio jump by 10 ms."""

BLIND = 0.3
"""s of dead reckoning without a pose before the contact that a start state bears."""

LONGEST_FLIP = 0.8
"""s from the trigger to the first contact; the paper's take 0.2."""

LONGEST = 1.5
"""s after the contact that belong to the landing."""

_GYRO = ("gx", "gy", "gz")
_POSE = ("qx", "qy", "qz", "qw", "x", "y", "z")


@dataclass(frozen=True)
class LandingSegment:
    """One landing.

    Attributes:
        trigger: s, when the flip began.
        before, after: s, times of the gyro samples between which something first touched.
        gyro_t, gyro: s and rad/s, (n,) and (n, 3), from the trigger on.
        pose_t, pose: s, (m,), and quaternion with position (m), (m, 7), where the pose can be trusted.
        tracked: whether the pose can be trusted after the contact (motion capture), or only before the flip.
    """

    flight: Flight
    trigger: float
    before: float
    after: float
    gyro_t: FloatArray
    gyro: FloatArray
    pose_t: FloatArray
    pose: FloatArray
    tracked: bool

    @property
    def name(self) -> str:
        """Name of the flight."""
        return self.flight.name

    @property
    def contact(self) -> float:
        """Middle of the interval that holds the first contact (s)."""
        return 0.5 * (self.before + self.after)


def landing_of(flight: Flight) -> LandingSegment | NotUsed:
    """The landing of one flight, or why there is none."""
    if flight.trigger is None:
        return NotUsed(flight.name, "the flight has no flip")
    motion = motion_of(flight)
    if motion is None:
        return NotUsed(flight.name, "a landing needs gyro and pose")
    t, rates, pose_t, pose = motion
    start = _flip_start(t, rates, flight.trigger.t)
    touched = first_contact(t, rates, start)
    if touched is None:
        return NotUsed(flight.name, f"nothing touched within {LONGEST_FLIP} s after the flip began")
    before, after = touched
    end = after + LONGEST
    tracked = flight.pose_source is not PoseSource.ONBOARD_ESTIMATE
    # An onboard estimate is trusted up to the flip only: the filter fails during some of them.
    used = (pose_t > start - 0.4) & (pose_t < (end if tracked else start + 1e-9))
    if np.count_nonzero(used) < 3:
        return NotUsed(flight.name, "no pose around the flip")
    if tracked and not np.any(used & (pose_t > before - BLIND) & (pose_t <= before)):
        return NotUsed(flight.name, f"no pose in the last {BLIND} s before the contact")
    rows = (t > start - 0.4) & (t < end)
    if np.count_nonzero(t[rows] > after) < 8:
        return NotUsed(flight.name, "the gyro ends with the contact")
    pose = continued(pose[used])
    return LandingSegment(flight, start, before, after, t[rows], rates[rows], pose_t[used], pose, tracked)


class Motion(NamedTuple):
    """What gyro and tracker said: times (s) and rates (rad/s, (n, 3)), times and quaternion with position
    (m, (m, 7))."""

    t: FloatArray
    rates: FloatArray
    pose_t: FloatArray
    pose: FloatArray


def motion_of(flight: Flight) -> Motion | None:
    """Samples of gyro, each once, and pose by the clocks of their sources; None without either."""
    gyro = samples_of(flight, *_GYRO, clock="rates_drone_time")
    tracker = samples_of(flight, *_POSE, clock="capture_time")
    if gyro is None or tracker is None:
        return None
    return Motion(*fresh(gyro.t, gyro.values), tracker.t, tracker.values)


def continued(pose: FloatArray) -> FloatArray:
    """Poses, shape (n, 7), whose quaternions have the sign that is nearest to the one before."""
    return np.hstack([continuous_quaternions(pose[:, :4]), pose[:, 4:]])


def first_contact(t: FloatArray, rates: FloatArray, start: float) -> tuple[float, float] | None:
    """Times of the samples around the first sudden change of the rate after `start`; None without one."""
    for k in np.flatnonzero((t > start + 0.02) & (t <= start + LONGEST_FLIP)):
        line = np.flatnonzero((t >= t[k - 1] - STRAIGHT) & (t < t[k]))
        if line.size < 3:
            continue
        at = t[line] - t[k - 1]
        fit = np.polyfit(at, rates[line], 2 if line.size > 4 else 1)
        step = t[k] - t[k - 1]
        expected = sum(coefficient * step**power for power, coefficient in enumerate(fit[::-1]))
        # A gap in the log makes the line worth less.
        if np.linalg.norm(rates[k] - expected) > JUMP * max(1.0, step / 0.02):
            return float(t[k - 1]), float(t[k])
    return None


def _flip_start(t: FloatArray, rates: FloatArray, trigger: float) -> float:
    """The trigger, or the last moment before it without rotation: some formats tell it from the tilt."""
    calm = np.flatnonzero((t <= trigger) & (np.abs(rates[:, 1]) < 1.0))
    return float(t[calm[-1]]) if calm.size else trigger


def fresh(t: FloatArray, rates: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Samples without repeated messages and equal times."""
    new = np.ones(t.size, dtype=np.bool_)
    new[1:] = (np.diff(t) > 5e-4) & np.any(np.diff(rates, axis=0) != 0.0, axis=1)
    return t[new], rates[new]


_MOTORS = ("m1", "m2", "m3", "m4")
_THRUSTS = ("f1", "f2", "f3", "f4")


def commanded_thrusts(flight: Flight, vehicle: Vehicle) -> tuple[FloatArray, FloatArray] | None:
    """Times (n,) (s) and thrusts (n, 4) (N) that the motors were told; None without commands.

    Commanded thrusts are taken where they were logged (their battery compensation is then taken as perfect);
    else PWM and battery voltage go through the vehicle's thrust map.
    """
    if flight.has(*_THRUSTS):
        return flight.series(*_THRUSTS)
    pwm = samples_of(flight, *_MOTORS, clock="motors_drone_time")
    volts = samples_of(flight, "vbat")
    if pwm is None or volts is None:
        return None
    supply = np.interp(pwm.t, volts.t, volts.values[:, 0])
    thrust_map = vehicle.motors.thrust_map_compiled()
    at_motor = np.clip(pwm.values / FULL_RATIO, 0.0, 1.0) * supply[:, None]
    thrust = np.array([[thrust_from_voltage(thrust_map, float(v)) for v in row] for row in at_motor])
    return pwm.t, thrust


def running_until(commands: tuple[FloatArray, FloatArray], at: float) -> tuple[FloatArray, FloatArray] | None:
    """Commands (s; N) up to the last row until `at` (s) in which all four motors run; None without one.

    Some logs have the thrusts of a flip one row before its flag.
    """
    t, thrust = commands
    rows = np.flatnonzero((t <= at) & (thrust.min(axis=1) > 0.0))
    return (t[: rows[-1] + 1], thrust[: rows[-1] + 1]) if rows.size else None


def on_steps(times: FloatArray, thrusts: FloatArray, start: float, steps: int) -> FloatArray:
    """Thrusts (N, (steps, 4)) that hold in each step of 1 ms from `start` (s) on: the last that was told."""
    at = start + DT * (np.arange(steps) + 0.5)
    row = np.searchsorted(times, at, side="right") - 1
    return np.ascontiguousarray(thrusts[np.clip(row, 0, len(times) - 1)])
