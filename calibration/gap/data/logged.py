"""The signals that a record needs, each at its own times and without what was made up."""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from calibration.flights.flight import POSE_CHANNELS, Flight, UnusableFlightError
from calibration.gap.data.kinematics import continuous_quaternions
from calibration.gap.data.plausible import check_range
from calibration.gap.data.radio import ReceivedSignal, received
from calibration.gap.data.samples import Samples, check_rate, samples_of
from onboard.battery import FULL_RATIO

_LONGEST_BREAK_S = 60.0
_STANDING_SHARE = 0.6


def check_clock(flight: Flight, pose: Samples) -> None:
    """Refuse a flight whose clock stands still or jumps.

    Raises:
        UnusableFlightError: it does.
    """
    rows = int(np.count_nonzero(flight.valid["x"]))
    if pose.t.size < (1.0 - _STANDING_SHARE) * rows:
        raise UnusableFlightError(
            flight.source,
            f"broken clock: {rows - pose.t.size} of {rows} poses have the time of the one before",
        )
    steps = np.diff(pose.t)
    widest = int(np.argmax(steps))
    if steps[widest] > _LONGEST_BREAK_S:
        raise UnusableFlightError(
            flight.source, f"broken clock: time jumps by {steps[widest]:.1f} s at {pose.t[widest]:.3f} s"
        )


# Second differences below these are those of a straight line: far below the noise, far above rounding.
_PWM_RESOLUTION = 2.0
_GYRO_RESOLUTION = 1e-5  # rad/s
_ACCELEROMETER_RESOLUTION = 1e-4  # m/s2


@dataclass(frozen=True)
class LoggedSignals:
    """What a flight holds.

    Attributes:
        pose: x, y, z, qx, qy, qz, qw; quaternions of unit length and continuous sign.
        gyro: rad/s.
        motors: PWM, within 0..65535.
        accelerometer: m/s2, or None.
        battery: V, or None.
        notes: what was taken out, in words.
    """

    pose: Samples
    gyro: ReceivedSignal
    motors: ReceivedSignal
    accelerometer: ReceivedSignal | None
    battery: Samples | None
    notes: tuple[str, ...]


def read_signals(flight: Flight) -> LoggedSignals:
    """The signals of `flight`.

    Raises:
        UnusableFlightError: pose, gyro or motor commands are missing or no use; names the reason.
    """
    pose = _required(flight, "pose", "capture_time", *POSE_CHANNELS)
    check_clock(flight, pose)
    check_rate(flight, pose, "pose")
    pose.values[:, 3:] = continuous_quaternions(pose.values[:, 3:])
    gyro = _required(flight, "gyro", "rates_drone_time", "gx", "gy", "gz")
    check_rate(flight, gyro, "gyro")
    motors, clipped = _motors(flight)
    accelerometer = samples_of(flight, "ax", "ay", "az", clock="acceleration_drone_time")
    measured = LoggedSignals(
        pose=pose,
        gyro=_measured(flight, "gyro", received(gyro, _GYRO_RESOLUTION)),
        motors=motors,
        accelerometer=None
        if accelerometer is None
        else _measured(flight, "accelerometer", received(accelerometer, _ACCELEROMETER_RESOLUTION)),
        battery=samples_of(flight, "vbat"),
        notes=(),
    )
    return replace(measured, notes=tuple(_notes(measured, clipped)))


def _required(flight: Flight, what: str, clock: str, *names: str) -> Samples:
    samples = samples_of(flight, *names, clock=clock)
    if samples is None:
        raise UnusableFlightError(flight.source, f"no {what}")
    return samples


def _measured(flight: Flight, what: str, signal: ReceivedSignal) -> ReceivedSignal:
    if signal.samples.t.size < 2:
        raise UnusableFlightError(flight.source, f"no {what}: its log is a straight line throughout")
    return signal


def _motors(flight: Flight) -> tuple[ReceivedSignal, int]:
    """Motor commands as received, and how many of them were clipped."""
    pwm = _required(flight, "motor commands", "motors_drone_time", "m1", "m2", "m3", "m4")
    check_rate(flight, pwm, "motor commands")
    off = np.all(pwm.values == 0.0, axis=1)
    if off.all():
        raise UnusableFlightError(flight.source, "never flies: the motor commands are 0 throughout")
    check_range(flight, pwm)
    signal = _measured(flight, "motor commands", received(pwm, _PWM_RESOLUTION, off, may_stand=True))
    values = signal.samples.values
    clipped = np.clip(values, 0.0, FULL_RATIO)
    count = int(np.count_nonzero(np.any(clipped != values, axis=1)))
    return ReceivedSignal(Samples(signal.samples.t, clipped), signal.lost_s, signal.dead_s), count


def _notes(signals: LoggedSignals, clipped: int) -> Iterator[str]:
    if clipped:
        yield f"{clipped} motor commands beyond 0..65535 clipped"
    received_ones = {"motor commands": signals.motors, "gyro": signals.gyro}
    if signals.accelerometer is not None:
        received_ones["accelerometer"] = signals.accelerometer
    for what, signal in received_ones.items():
        if signal.lost_s > 0.0:
            yield f"{what}: {signal.lost_s:.2f} s lost in radio gaps"
        if signal.dead_s > 1.0:
            yield f"{what}: dead for the last {signal.dead_s:.1f} s"
