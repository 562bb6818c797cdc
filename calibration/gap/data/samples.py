"""Samples of a flight's channels at the times at which they were taken, and one time grid for all of them."""

from dataclasses import dataclass

import numpy as np

from calibration.flights.flight import Flight, UnusableFlightError
from onboard.arrays import BoolArray, FloatArray

INTERVAL_S = 0.01
"""Sample interval of a record: the rate at which a Crazyflie's log and most motion capture can follow."""

_SLOWER = 1.5  # times the record's interval from which a slow channel decides about it
_SAME_GRID = 0.01  # share of an interval by which sample times may be off a uniform grid
_WIDEST_GAP = 3.0  # intervals of the channel itself between which it is still interpolated
_SLOWEST_S = 0.05  # a channel sampled more slowly does not show a quadrotor's motion

_DRONE_TIMES = ("rates_drone_time", "acceleration_drone_time", "motors_drone_time", "cues_drone_time")


@dataclass(frozen=True)
class Samples:
    """One quantity at its own times.

    Attributes:
        t: strictly increasing (s), shape (n,).
        values: shape (n, k).
    """

    t: FloatArray
    values: FloatArray

    @property
    def interval(self) -> float:
        """Median time between samples (s)."""
        return float(np.median(np.diff(self.t)))

    def where(self, keep: BoolArray) -> "Samples":
        """The samples of the mask `keep`."""
        return Samples(self.t[keep], self.values[keep])


def samples_of(flight: Flight, *names: str, clock: str | None = None) -> Samples | None:
    """The valid samples of channels that come together; None when there are fewer than two.

    Args:
        flight: the flight.
        names: the channels.
        clock: channel that holds the source's own time of these samples, used when every one has it: the
            times of receipt jitter. Drone times are put on the time column by the shortest delay of any.

    Of samples with one and the same time the first is taken.
    """
    if not flight.has(*names):
        return None
    t, values = flight.series(*names)
    if clock is not None and flight.has(clock):
        _, own = flight.series(*names, clock)
        if own.shape[0] == t.size:
            t = own[:, -1] + _offset(flight, clock)
            order = np.argsort(t, kind="stable")
            t, values = t[order], values[order]
    fresh = np.concatenate([[True], np.diff(t) > 0.0])
    return Samples(t[fresh], values[fresh]) if np.count_nonzero(fresh) > 1 else None


def _offset(flight: Flight, clock: str) -> float:
    """What a time of `clock` lacks to the time column (s): the same for all channels of the drone."""
    if clock not in _DRONE_TIMES:
        return 0.0
    offsets = []
    for name in _DRONE_TIMES:
        if flight.has(name):
            t, own = flight.series(name)
            offsets.append(float(np.min(t - own[:, 0])))
    return min(offsets)


def check_rate(flight: Flight, samples: Samples, what: str) -> None:
    """Refuse a quantity that is sampled too slowly to show the motion.

    Raises:
        UnusableFlightError: it is.
    """
    if samples.interval > _SLOWEST_S:
        raise UnusableFlightError(
            flight.source,
            f"{what} sampled every {samples.interval:.3g} s; at least every {_SLOWEST_S:g} s is needed"
            " (are the times in seconds?)",
        )


def grid_interval(*channels: Samples) -> float:
    """Sample interval (s) that suits these measurements: the slowest's, where it is slower than a record's.

    Put on a finer grid, its lines would leave images of what it shows at other frequencies.
    """
    slowest = max(channel.interval for channel in channels)
    return slowest if slowest > _SLOWER * INTERVAL_S else INTERVAL_S


def uniform_grid(interval: float, pose: Samples, *others: Samples) -> FloatArray:
    """A uniform time grid that `pose` and `others` cover; the pose's own, if that has this `interval`."""
    first = max(float(c.t[0]) for c in (pose, *others))
    last = min(float(c.t[-1]) for c in (pose, *others))
    own = pose.t[(pose.t >= first) & (pose.t <= last)]
    if _uniform(own, interval):
        return own
    count = max(int(np.floor((last - first) / interval + 1e-9)) + 1, 0)
    return np.asarray(first + interval * np.arange(count), dtype=np.float64)


def _uniform(t: FloatArray, interval: float) -> bool:
    if t.size < 2:
        return False
    steps = np.diff(t)
    mean = (t[-1] - t[0]) / (t.size - 1)
    return bool(0.8 * interval < mean < 1.25 * interval) and bool(
        np.all(np.abs(steps - mean) < _SAME_GRID * mean)
    )


def resample(samples: Samples, t: FloatArray) -> tuple[FloatArray, BoolArray]:
    """Values on the grid `t`, shape (m, k), and where they are known, shape (m,).

    Linear between samples; a quantity sampled at twice the grid's rate or faster is averaged over one
    interval of the grid, so that vibration does not alias. Unknown where the samples on both sides are
    further apart than three of the quantity's own intervals.
    """
    if np.array_equal(samples.t, t):
        return samples.values.copy(), np.ones(t.size, dtype=np.bool_)
    interval = float((t[-1] - t[0]) / (t.size - 1))
    if samples.interval <= 0.5 * interval:
        values = _averaged(samples, t, interval)
    else:
        values = np.column_stack([np.interp(t, samples.t, column) for column in samples.values.T])
    after = np.clip(np.searchsorted(samples.t, t, side="left"), 1, samples.t.size - 1)
    gap = samples.t[after] - samples.t[after - 1]
    slack = 1e-6 * interval
    inside = (t >= samples.t[0] - slack) & (t <= samples.t[-1] + slack)
    exact = np.abs(samples.t[after] - t) < slack
    return values, inside & (exact | (gap <= _WIDEST_GAP * samples.interval + slack))


def _averaged(samples: Samples, t: FloatArray, interval: float) -> FloatArray:
    """Mean of the linear interpolation over one `interval` around each of `t`."""
    steps = np.diff(samples.t)[:, None]
    area = np.zeros_like(samples.values)
    area[1:] = np.cumsum(0.5 * (samples.values[1:] + samples.values[:-1]) * steps, axis=0)
    low = np.clip(t - 0.5 * interval, samples.t[0], samples.t[-1])
    high = np.clip(t + 0.5 * interval, samples.t[0], samples.t[-1])
    columns = [(np.interp(high, samples.t, a) - np.interp(low, samples.t, a)) / (high - low) for a in area.T]
    return np.column_stack(columns)
