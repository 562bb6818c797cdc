"""One measured flight as the gap finder works on it: every channel on one time grid, with masks.

:mod:`calibration.gap.data` makes these records from :class:`calibration.flights.Flight` and decides what
of a flight can be used.
"""

import math
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path

import numpy as np
from scipy.signal import lfilter

from calibration.errors import CalibrationError
from calibration.flights.flight import PoseSource
from onboard.arrays import BoolArray, FloatArray


@dataclass(frozen=True, kw_only=True)
class FlightRecord:
    """A flight on a uniform grid. World ENU, body FLU, quaternions scalar-last, body to world.

    Attributes:
        name: short name.
        source: file or folder.
        shape: name of the trajectory's shape; flights of one shape are trained on, or held out, together.
        t: time (s) on the onboard clock, shape (n,), uniform.
        position: m, world, shape (n, 3), of the tracked origin.
        velocity: m/s, world, shape (n, 3).
        attitude: shape (n, 4).
        rate: rad/s, body, shape (n, 3): the gyro.
        specific_force: m/s2, body, shape (n, 3): the accelerometer; None without one.
        duty: shape (n, 4), share of the battery voltage at each motor, 0..1.
        voltage: V, shape (n,), battery under load; None without it.
        voltage_measured: False where the voltage was made: the one at which the vehicle hovers.
        voltage_lag: s, of the first order in which the voltage follows the current.
        flying: shape (n,): in the air, clear of floor and ceiling.
        motors_known: shape (n,): False where the motor commands were lost or made up.
        pose_known, inertial_known: shape (n,): likewise for pose, and for gyro and accelerometer.
        resting: shape (n,): on the floor with the motors off, before the flight.
        pose_source: where the pose comes from; only motion capture and truth are independent of the gyro.
        ceiling_z: m, if known.
        notes: what was mended or left out, in words.
    """

    name: str
    source: Path
    shape: str
    t: FloatArray
    position: FloatArray
    velocity: FloatArray
    attitude: FloatArray
    rate: FloatArray
    specific_force: FloatArray | None
    duty: FloatArray
    voltage: FloatArray | None
    flying: BoolArray
    motors_known: BoolArray
    pose_known: BoolArray
    inertial_known: BoolArray
    resting: BoolArray
    pose_source: PoseSource = PoseSource.MOCAP
    ceiling_z: float | None = None
    voltage_measured: bool = True
    voltage_lag: float = 0.0
    notes: tuple[str, ...] = field(default=())

    def __post_init__(self) -> None:
        """Check the shapes that every analysis relies on."""
        count = self.t.size
        for name, width in (("position", 3), ("velocity", 3), ("attitude", 4), ("rate", 3), ("duty", 4)):
            if getattr(self, name).shape != (count, width):
                raise CalibrationError(f"{self.source}: {name} must have shape ({count}, {width})")
        steps = np.diff(self.t)
        if count < 2 or np.any(np.abs(steps - steps.mean()) > 0.02 * steps.mean()):
            raise CalibrationError(
                f"{self.source}: a record needs a uniform time grid of two samples or more"
            )

    @cached_property
    def inputs(self) -> tuple[FloatArray, ...]:
        """Position, velocity, attitude, rate, duty, voltage as compiled code takes them: 0 where not known.

        Raises:
            CalibrationError: the flight has no battery voltage, so that a command means no thrust.
        """
        known = (self.position, self.velocity, self.attitude, self.rate, self.duty, self.known_voltage)
        return tuple(np.ascontiguousarray(np.nan_to_num(values)) for values in known)

    @property
    def known_voltage(self) -> FloatArray:
        """V, shape (n,), measured or made.

        Raises:
            CalibrationError: there is none, so that a command means no thrust.
        """
        if self.voltage is None:
            raise CalibrationError(
                f"{self.source}: no battery voltage, and a command means no thrust without"
            )
        return self.voltage

    def late_voltage(self, at_once: FloatArray) -> FloatArray:
        """What the current does to the voltage, shape (n,), as it shows with the flight's lag.

        Exact for a course that is straight between two samples, and settled at the first one.
        """
        if self.voltage_lag == 0.0:
            return at_once
        steps = self.dt / self.voltage_lag
        keep = math.exp(-steps)
        newest = 1.0 - (1.0 - keep) / steps
        weights = [newest, 1.0 - keep - newest]
        late, _ = lfilter(weights, [1.0, -keep], at_once, zi=[(1.0 - newest) * at_once[0]])
        return np.asarray(late)

    def under(self, ceiling_z: float | None) -> "FlightRecord":
        """The flight below a ceiling at this height (m); None: nobody knows better than the record."""
        return self if ceiling_z is None else replace(self, ceiling_z=ceiling_z)

    @property
    def dt(self) -> float:
        """Sample interval (s)."""
        return float((self.t[-1] - self.t[0]) / (self.t.size - 1))


@dataclass(frozen=True)
class NotUsed:
    """A flight or file that one of the analyses cannot use, by name, and why."""

    name: str
    reason: str

    def json_shape(self) -> dict[str, str]:
        """As every report of the gap finder has it."""
        return {"file": self.name, "reason": self.reason}
