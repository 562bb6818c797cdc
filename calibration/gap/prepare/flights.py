"""Make the record of a flight, or say why it cannot be used."""

from collections.abc import Sequence

import numpy as np

from calibration.flights.flight import POSE_CHANNELS, Flight, UnusableFlightError
from calibration.gap.prepare.attitude import continuous_quaternions
from calibration.gap.prepare.clock import check_clock
from calibration.gap.prepare.duplicates import duplicate_of
from calibration.gap.prepare.grid import Samples, check_rate, resample, samples_of, uniform_grid
from calibration.gap.prepare.limits import limitations
from calibration.gap.prepare.motor_log import FULL_SCALE, MotorLog, measured_commands
from calibration.gap.prepare.phases import airborne, clear_of_floor, resting
from calibration.gap.prepare.result import Prepared, Refusal
from calibration.gap.prepare.shapes import shapes_of
from calibration.gap.prepare.velocity import differentiate
from calibration.gap.record import FlightRecord
from onboard.arrays import BoolArray, FloatArray

_LEAST_FLYING_S = 1.0
_CONTACT_MARGIN_S = 0.1


def prepare_flights(flights: Sequence[Flight]) -> Prepared:
    """Records of all flights that can be used; the others with the reason.

    Nothing that a sensing effect explains is corrected here (clock between pose and gyro, turned or shifted
    frame, biases): that is for :mod:`calibration.gap.sensing` to find and to correct.
    """
    records, refused = [], []
    copies = duplicate_of(flights)
    for flight, copied, shape in zip(flights, copies, shapes_of(flights), strict=True):
        if copied is not None:
            refused.append(Refusal(flight.source, f"holds the same numbers as {copied.source}"))
            continue
        try:
            records.append(prepare_flight(flight, shape))
        except UnusableFlightError as error:
            refused.append(Refusal(error.source, error.reason))
    return Prepared(tuple(records), tuple(refused), limitations(records))


def prepare_flight(flight: Flight, shape: str) -> FlightRecord:
    """The record of one flight.

    Raises:
        UnusableFlightError: it cannot be used; names the reason.
    """
    pose = _required(flight, "pose", *POSE_CHANNELS)
    check_clock(flight, pose)
    check_rate(flight, pose, "pose")
    gyro = _required(flight, "gyro", "gx", "gy", "gz")
    check_rate(flight, gyro, "gyro")
    motors = _motors(flight)
    accelerometer = samples_of(flight, "ax", "ay", "az")
    battery = samples_of(flight, "vbat")
    pose.values[:, 3:] = continuous_quaternions(pose.values[:, 3:])

    t = uniform_grid(pose, gyro, motors.samples)
    if t.size < _LEAST_FLYING_S * 100:
        raise UnusableFlightError(flight.source, "pose, gyro and motor commands do not overlap in time")
    poses, pose_known = resample(pose, t)
    rate, inertial_known = resample(gyro, t)
    pwm, motors_known = resample(motors.samples, t)
    specific_force = None
    if accelerometer is not None:
        specific_force, known = resample(accelerometer, t)
        inertial_known &= known
    position, attitude = poses[:, :3], continuous_quaternions(poses[:, 3:])
    rest = resting(t, pwm, rate, position)
    flying = _flying(flight, t, pwm, position, rest)
    return FlightRecord(
        name=flight.name,
        source=flight.source,
        shape=shape,
        t=t,
        position=position,
        velocity=differentiate(position, float((t[-1] - t[0]) / (t.size - 1))),
        attitude=attitude,
        rate=rate,
        specific_force=specific_force,
        duty=pwm / FULL_SCALE,
        voltage=None if battery is None else resample(battery, t)[0][:, 0],
        flying=flying,
        motors_known=motors_known,
        pose_known=pose_known,
        inertial_known=inertial_known,
        resting=rest,
        pose_source=flight.pose_source,
        ceiling_z=flight.ceiling_z,
        notes=(*flight.notes, *_notes(motors)),
    )


def _required(flight: Flight, what: str, *names: str) -> Samples:
    samples = samples_of(flight, *names)
    if samples is None:
        raise UnusableFlightError(flight.source, f"no {what}")
    return samples


def _motors(flight: Flight) -> MotorLog:
    samples = _required(flight, "motor commands", "m1", "m2", "m3", "m4")
    check_rate(flight, samples, "motor commands")
    if not np.any(samples.values > 0.0):
        raise UnusableFlightError(flight.source, "never flies: the motor commands are 0 throughout")
    log = measured_commands(samples)
    if log.samples.t.size < 2:
        raise UnusableFlightError(flight.source, "no motor commands: the log is a straight line throughout")
    return log


def _flying(
    flight: Flight, t: FloatArray, pwm: FloatArray, position: FloatArray, rest: BoolArray
) -> BoolArray:
    """Samples in free flight.

    Raises:
        UnusableFlightError: there are too few.
    """
    flying = airborne(t, pwm, np.ones(t.size, dtype=np.bool_))
    if not flying.any():
        raise UnusableFlightError(flight.source, "never flies: the motors do not run long enough")
    clear = clear_of_floor(position, rest)
    if np.count_nonzero(flying & clear) < 0.5 * np.count_nonzero(flying):
        raise UnusableFlightError(flight.source, "stays on the floor with the motors running")
    flying &= clear
    if flight.trigger is not None:  # the landing has an analysis of its own
        flying &= t < flight.trigger.t
    for name in ("body_contact", "legs_attached"):
        touch = samples_of(flight, name)
        if touch is not None:
            at = touch.t[touch.values[:, 0] > 0.0]
            flying &= ~_near(t, at, _CONTACT_MARGIN_S)
    if np.count_nonzero(flying) * (t[1] - t[0]) < _LEAST_FLYING_S:
        raise UnusableFlightError(flight.source, f"less than {_LEAST_FLYING_S:g} s in free flight")
    return flying


def _near(t: FloatArray, moments: FloatArray, margin: float) -> BoolArray:
    """Where a time of `t` has one of the increasing `moments` within `margin` (s)."""
    return np.searchsorted(moments, t + margin, "right") > np.searchsorted(moments, t - margin, "left")


def _notes(motors: MotorLog) -> tuple[str, ...]:
    notes = []
    if motors.lost_s > 0.0:
        notes.append(f"{motors.lost_s:.2f} s of motor commands lost in radio gaps")
    if motors.dead_s > 0.0:
        notes.append(f"log is dead for the last {motors.dead_s:.1f} s")
    if motors.clipped:
        notes.append(f"{motors.clipped} motor commands beyond 0..65535 clipped")
    return tuple(notes)
