"""The samples of a flight's channels at the times at which they were taken, not at which they arrived."""

import numpy as np

from calibration.flights.flight import Flight
from calibration.gap.data.grid import Samples

_DRONE_TIMES = ("rates_drone_time", "acceleration_drone_time", "motors_drone_time", "cues_drone_time")


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
