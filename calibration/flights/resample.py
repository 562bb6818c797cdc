"""A flight on one clock: every channel at the same times, and nothing invented where nothing was measured.

Between two neighbouring samples of a channel values are interpolated on a straight line (a quaternion then
normalised), and held where they count or switch; but only where the two are no farther apart than
`GAP_PERIODS` of the channel's own period, the median of its steps. Beyond, and outside of its samples, a
channel has no value.
"""

from dataclasses import dataclass

import numpy as np

from calibration.errors import CalibrationError
from calibration.flights.flight import CHANNELS, Flight
from onboard.arrays import FloatArray
from onboard.errors import InputError

GAP_PERIODS = 2.5
"""So one sample may be missing, two may not."""
RATE_HZ = 100.0
"""Of our log blocks."""
_RATE_MAX_HZ = 10_000.0
_SAME_S = 1e-6
"""Times that differ by less are one, s."""
_QUATERNION = ("qx", "qy", "qz", "qw")
_HELD = frozenset({"triggered", "landing_state", "legs_attached", "body_contact"})


class ResampleError(CalibrationError, InputError):
    """The flight cannot be put on this clock."""


@dataclass(frozen=True)
class Resampled:
    """Channels on one clock.

    Attributes:
        rate_hz: of the clock.
        t: times (n,), s: whole multiples of the period from the flight's first row on.
        data: by channel (n,), NaN where there is no value.
    """

    rate_hz: float
    t: FloatArray
    data: dict[str, FloatArray]

    @property
    def units(self) -> dict[str, str]:
        """Unit of each column, ``t`` included."""
        return {"t": "s", **{name: CHANNELS[name].unit for name in self.data}}


def resample(flight: Flight, rate_hz: float = RATE_HZ) -> Resampled:
    """Put `flight` on one clock.

    Args:
        flight: with at least one row.
        rate_hz: of the clock, Hz.

    Raises:
        ResampleError: the rate is none.
    """
    if not 0.0 < rate_hz <= _RATE_MAX_HZ:
        raise ResampleError(f"rate {rate_hz:g} Hz: give one of more than 0 and at most {_RATE_MAX_HZ:g} Hz")
    begin, end = float(flight.t[0]), float(flight.t[-1])
    t = begin + np.arange(int((end - begin) * rate_hz + 1e-6) + 1) / rate_hz
    data = {}
    for name in flight.data:
        if name not in _QUATERNION:
            times, values = flight.series(name)
            data[name] = _on_clock(t, times, values, held=name in _HELD)[:, 0]
    if flight.has(*_QUATERNION):
        times, turns = flight.series(*_QUATERNION)
        flips = np.cumprod(np.where((turns[1:] * turns[:-1]).sum(axis=1) < 0.0, -1.0, 1.0))
        turns[1:] *= flips[:, None]  # q and -q are one attitude
        between = _on_clock(t, times, turns, held=False)
        between /= np.linalg.norm(between, axis=1, keepdims=True)
        data |= {name: between[:, i] for i, name in enumerate(_QUATERNION)}
    return Resampled(rate_hz, t, {name: data[name] for name in flight.data if name in data})


def _on_clock(t: FloatArray, times: FloatArray, values: FloatArray, *, held: bool) -> FloatArray:
    """Samples `values` (m, k) taken at `times` (m,), at the times `t` (n,): (n, k)."""
    result = np.full((t.size, values.shape[1]), np.nan)
    if times.size == 0:
        return result
    steps = np.diff(times)
    steps = steps[steps > 0.0]
    bridged = GAP_PERIODS * float(np.median(steps)) if steps.size else 0.0
    before = np.searchsorted(times, t + _SAME_S, side="right") - 1
    after = np.minimum(before + 1, times.size - 1)
    inside = (before >= 0) & ((before < times.size - 1) | (t <= times[-1] + _SAME_S))
    before = np.maximum(before, 0)
    gap = times[after] - times[before]
    on_sample = np.abs(t - times[before]) <= _SAME_S
    known = inside & (on_sample | (gap <= bridged))
    share = np.divide(t - times[before], gap, out=np.zeros(t.size), where=gap > 0.0)
    share = np.zeros(t.size) if held else np.where(on_sample, 0.0, share)
    line = values[before] + share[:, None] * (values[after] - values[before])
    result[known] = line[known]
    return result
