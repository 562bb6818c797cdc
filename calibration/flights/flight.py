"""One flight as numbers: the type that every loader returns and every analysis reads.

A :class:`Flight` is a table of named channels over one time column. Sources sample their quantities at
different moments; a row then holds what arrived at that time, and a channel that did not is not valid there.
:meth:`Flight.series` gives one channel's own samples.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from pathlib import Path

import numpy as np

from calibration.errors import CalibrationError
from onboard.arrays import BoolArray, FloatArray
from onboard.errors import InputError


class FlightFileError(CalibrationError, InputError):
    """A flight file is broken; the message names the file and, where there is one, row and column."""


class UnusableFlightError(CalibrationError, InputError):
    """A file is readable, but what it holds is no usable flight; `reason` says why."""

    def __init__(self, source: Path, reason: str) -> None:
        super().__init__(f"{source}: not a usable flight: {reason}")
        self.source = source
        self.reason = reason


class PoseSource(StrEnum):
    """Where the pose channels come from, which decides what they can show."""

    MOCAP = "mocap"
    ONBOARD_ESTIMATE = "onboard_estimate"
    TRUTH = "truth"


@dataclass(frozen=True)
class Channel:
    """What a channel means: unit, frame and meaning."""

    unit: str
    frame: str
    meaning: str


def _named(names: str, unit: str, frame: str, meaning: str) -> dict[str, Channel]:
    return {name: Channel(unit, frame, meaning) for name in names.split()}


CHANNELS: dict[str, Channel] = {
    **_named("x y z", "m", "world", "position of the body's origin"),
    **_named("qx qy qz qw", "1", "body to world", "attitude quaternion, scalar last"),
    **_named("vx vy vz", "m/s", "world", "velocity"),
    **_named("gx gy gz", "rad/s", "body", "rate, from the gyro"),
    **_named("ax ay az", "m/s2", "body", "specific force, from the accelerometer"),
    **_named(
        "m1 m2 m3 m4",
        "pwm_u16",
        "",
        "motor command, M1 front right, M2 back right, M3 back left, M4 front left",
    ),
    **_named("f1 f2 f3 f4", "N", "", "commanded thrust per motor, numbered as m1..m4"),
    **_named("collective", "N", "body z", "commanded collective thrust"),
    **_named("moment_x moment_y moment_z", "N m", "body", "commanded moment"),
    **_named("vbat", "V", "", "battery voltage"),
    **_named("est_x est_y est_z", "m", "world", "position estimated on board, beside a mocap pose"),
    **_named("tau", "s", "", "time to contact d_ceil / v_z"),
    **_named("theta_x", "1/s", "", "optical flow v_x / d_ceil, positive forward"),
    **_named("d_ceil", "m", "", "ceiling height minus height of the body's origin"),
    **_named("cues_drone_time", "s", "", "the drone's own time of tau, theta_x, d_ceil"),
    **_named("rates_drone_time", "s", "", "the drone's own time of gx, gy, gz"),
    **_named("acceleration_drone_time", "s", "", "the drone's own time of ax, ay, az"),
    **_named("motors_drone_time", "s", "", "the drone's own time of m1 to m4"),
    **_named("capture_time", "s", "", "when the cameras exposed, on the clock of the time column"),
    **_named("trigger_value", "1", "", "trigger policy; fires at >= 0"),
    **_named("a_rot", "N m", "body y", "flip moment; negative = nose up"),
    **_named("triggered", "1", "", "1 once the policy has fired"),
    **_named("landing_state", "1", "", "onboard.landing.LandingState"),
    **_named("setpoint_x setpoint_y setpoint_z", "m", "world", "position setpoint"),
    **_named("setpoint_vx setpoint_vy setpoint_vz", "m/s", "world", "velocity setpoint"),
    **_named("setpoint_ax setpoint_ay setpoint_az", "m/s2", "world", "acceleration setpoint"),
    **_named("legs_attached", "1", "", "feet that hold (simulation truth)"),
    **_named("body_contact", "1", "", "1 while body or propellers touch (simulation truth)"),
    **_named("motor_max", "pwm_u16", "", "largest of the four motor commands (simulation truth)"),
}
"""Every channel that a flight may have. World: ENU, z up. Body: FLU (x forward, y left)."""

POSE_CHANNELS = ("x", "y", "z", "qx", "qy", "qz", "qw")


@dataclass(frozen=True)
class Trigger:
    """The moment at which the policy fired.

    Attributes:
        t: time in the flight's time column (s).
        snapshot: what was stored on board at that moment, by channel name (and ``pitch``, rad); may be empty.
        drone_time: the drone's own time of it (s), on the time base of ``cues_drone_time``, if known.
        inferred: from the attitude: the flip was under way already, or it was a crash.
    """

    t: float
    snapshot: dict[str, float] = field(default_factory=dict)
    drone_time: float | None = None
    inferred: bool = False


@dataclass(frozen=True)
class Flight:
    """One flight.

    Attributes:
        name: short name for tables.
        source: the file or folder that it was read from.
        format: name of the format.
        pose_source: where x..qw come from.
        t: time (s), shape (n,), never decreasing.
        data: values by channel name (:data:`CHANNELS`), each shape (n,) float64; NaN where missing.
        valid: by channel name, shape (n,): False where the value is missing or known to be wrong.
        trigger: when the policy fired, or None when it did not.
        commanded_speed: speed asked for (m/s), if known.
        commanded_angle_deg: angle above the horizon asked for (deg), if known.
        ceiling_z: height of the ceiling (m), if known.
        session: flights of one session were flown in one room, unchanged: the day where a file tells it, else
            the folder that holds it; empty: unknown.
        aborted_by: rule that aborted the flight, or None.
        finished: whether the file was finished by its writer (False: the writer was killed).
        notes: what the loader found wrong or left out, in words.
    """

    name: str
    source: Path
    format: str
    pose_source: PoseSource
    t: FloatArray
    data: dict[str, FloatArray]
    valid: dict[str, BoolArray]
    trigger: Trigger | None = None
    commanded_speed: float | None = None
    commanded_angle_deg: float | None = None
    ceiling_z: float | None = None
    session: str = ""
    aborted_by: str | None = None
    finished: bool = True
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        """Check what every analysis relies on."""
        unknown = self.data.keys() - CHANNELS.keys()
        if unknown:
            raise CalibrationError(f"{self.source}: unknown channels {sorted(unknown)}; add them to CHANNELS")
        if self.data.keys() != self.valid.keys():
            raise CalibrationError(f"{self.source}: data and valid must have the same channels")
        for name, values in self.data.items():
            if values.shape != self.t.shape or self.valid[name].shape != self.t.shape:
                raise CalibrationError(f"{self.source}: channel {name} must have shape {self.t.shape}")
        if np.any(np.diff(self.t) < 0):
            raise CalibrationError(f"{self.source}: time must not decrease")

    def has(self, *names: str) -> bool:
        """Whether the flight has all the channels `names` with at least one valid value each."""
        return all(name in self.valid and bool(self.valid[name].any()) for name in names)

    def series(self, *names: str) -> tuple[FloatArray, FloatArray]:
        """The valid samples of `names`: times (m,) and values (m, len(names)), rows where all are valid.

        Raises:
            CalibrationError: the flight does not have one of the channels.
        """
        missing = [name for name in names if name not in self.data]
        if missing:
            raise CalibrationError(f"{self.source}: no channel {', '.join(missing)}")
        rows = np.logical_and.reduce([self.valid[name] for name in names])
        return self.t[rows], np.column_stack([self.data[name][rows] for name in names])


def finite_masks(data: Mapping[str, FloatArray]) -> dict[str, BoolArray]:
    """Validity masks that hold wherever a value is a finite number."""
    return {name: np.isfinite(values) for name, values in data.items()}
