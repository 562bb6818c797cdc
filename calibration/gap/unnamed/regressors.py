"""What a residual may go with: place, motion, commands, battery, time; one number per row of the signals."""

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from calibration.gap.data.kinematics import HALF_WIDTH_S
from calibration.gap.data.record import FlightRecord
from calibration.gap.data.rotations import matrices
from onboard.arrays import FloatArray


@dataclass(frozen=True, eq=False)
class Regressor:
    """A quantity along all flights.

    Attributes:
        name: short name.
        symbol: how conditions call it ("vbat" in "vbat < 3.4 V").
        unit: of the values, empty for a pure number.
        values: shape (n,); NaN on flights where it is not known.
    """

    name: str
    symbol: str
    unit: str
    values: FloatArray

    def condition(self, low: float | None, high: float | None) -> str:
        """An interval in words; None where it is open."""
        below = "" if low is None else f"{self._number(low)} < "
        above = "" if high is None else f" < {self._number(high)}"
        if not above:
            return f"{self.symbol} > {self._number(float(low or 0.0))}"
        return f"{below}{self.symbol}{above}"

    def _number(self, value: float) -> str:
        return f"{value:.3g} {self.unit}".strip()


def regressors(records: Sequence[FlightRecord]) -> tuple[Regressor, ...]:
    """Every quantity that at least one flight knows, stacked as the signals are."""
    tables = [_along(record) for record in records]
    found = []
    for index, (name, symbol, unit) in enumerate(_QUANTITIES):
        values = np.concatenate([table[:, index] for table in tables])
        if np.isfinite(values).any():
            found.append(Regressor(name, symbol, unit, values))
    return tuple(found)


_QUANTITIES = (
    ("x", "x", "m"),
    ("y", "y", "m"),
    ("z", "z", "m"),
    ("ceiling_distance", "distance to the ceiling", "m"),
    ("velocity_x", "forward speed", "m/s"),
    ("velocity_y", "leftward speed", "m/s"),
    ("velocity_z", "speed along the thrust axis", "m/s"),
    ("airspeed", "airspeed", "m/s"),
    ("vertical_speed", "climb rate", "m/s"),
    ("voltage", "vbat", "V"),
    ("collective", "mean duty", ""),
    ("command_spread", "spread of the duties", ""),
    ("rate_x", "roll rate", "rad/s"),
    ("rate_y", "pitch rate", "rad/s"),
    ("rate_z", "yaw rate", "rad/s"),
    ("time", "time since take-off", "s"),
)
"""Name, symbol and unit of each column of :func:`_along`. Airspeed is that in still air."""

_VOLTAGE_MEAN, _RATE_MEAN, _DUTY_MEAN = 1.0, 0.05, 0.5
"""s, over which a reading is averaged: the battery's state rather than the noise of a sample; the turning
rather than the gyro's noise, which is in the angular acceleration too; the thrust that is flown with rather
than the answer to each jerk, of which a log at 100 Hz shows one in five, late."""


def _along(record: FlightRecord) -> FloatArray:
    unknown = np.full(record.t.size, np.nan)
    ceiling = record.ceiling_z
    # A velocity by central differences knows forces that have not acted yet: take one that is old enough.
    velocity = _earlier(record.velocity, HALF_WIDTH_S + record.dt, record.dt)
    attitude = _earlier(matrices(record.attitude), HALF_WIDTH_S + record.dt, record.dt)
    duty = _earlier(_recent_mean(record.duty, _DUTY_MEAN, record.dt), record.dt, record.dt)
    off = int(np.argmax(record.flying)) if record.flying.any() else 0
    return np.column_stack(
        [
            record.position,
            unknown if ceiling is None else ceiling - record.position[:, 2],
            np.einsum("nji,nj->ni", attitude, velocity),
            np.linalg.norm(velocity, axis=1),
            velocity[:, 2],
            unknown
            if record.voltage is None or not record.voltage_measured
            else _recent_mean(record.voltage[:, None], _VOLTAGE_MEAN, record.dt),
            duty.mean(axis=1),
            np.ptp(duty, axis=1),
            _earlier(_recent_mean(record.rate, _RATE_MEAN, record.dt), record.dt, record.dt),
            record.t - record.t[off],
        ]
    )


def _earlier(values: FloatArray, lag: float, dt: float) -> FloatArray:
    """Values as they were `lag` s before."""
    return values[np.maximum(np.arange(values.shape[0]) - round(lag / dt), 0)]


def _recent_mean(values: FloatArray, seconds: float, dt: float) -> FloatArray:
    """Mean of the last `seconds` of values, shape (n, k)."""
    width = max(1, round(seconds / dt))
    sums = np.cumsum(np.concatenate([np.repeat(values[:1], width, axis=0), values]), axis=0)
    return np.asarray((sums[width:] - sums[:-width]) / width)


_FAR = 0.5
"""Share of the largest departure that counts as far."""
_STANDARD_ERRORS = 2.5


def where_it_lives(
    regressor: Regressor, knots: FloatArray, profile: FloatArray, errors: FloatArray, time: FloatArray
) -> tuple[FloatArray, str]:
    """The profile about its median over time, and the condition under which it is far from that.

    Args:
        regressor: of the profile.
        knots: of the profile, shape (k,).
        profile, errors: at each knot, shape (k,).
        time: blocks that tell at each knot, shape (k,).
    """
    about = profile - weighted_median(profile, time)
    size = np.abs(about)
    far = (size > _FAR * size.max()) & (size > _STANDARD_ERRORS * errors)
    if not far.any():
        return about, f"nowhere along {regressor.symbol} in particular"
    signs = np.where(far, np.sign(about), 0.0)
    ends = [None, *(0.5 * (knots[1:] + knots[:-1])).tolist(), None]
    words, first = [], 0
    for sign, run in itertools.groupby(signs):
        last = first + len(list(run))
        if sign:
            words.append(regressor.condition(ends[first], ends[last]))
        first = last
    return about, " or ".join(words)


def weighted_median(values: FloatArray, weights: FloatArray) -> float:
    """The value with half of the weight on either side."""
    order = np.argsort(values)
    reached = np.cumsum(weights[order])
    return float(values[order][np.searchsorted(reached, 0.5 * reached[-1])])
