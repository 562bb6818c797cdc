"""Flights of one kind, by what was flown: what must be held out together to be unseen."""

from collections.abc import Sequence

import numpy as np
from scipy.cluster.hierarchy import fcluster, linkage
from scipy.spatial.distance import squareform

from calibration.gap.data.record import FlightRecord
from onboard.arrays import FloatArray

_ALIKE = 0.4
"""Largest difference of any quantity, as a logarithm, between flights of one kind, on average."""

_APART = 1.0
"""m between the middles of two flights that makes them as different as a factor of e does."""

_FLOORS = np.array([0.3, 0.3, 0.3, 0.4, 0.4, 0.4, 1.0, 1.0, 0.5, 0.1])
"""Extents (m), ranges of velocity (m/s), rate (rad/s) and duty below which differences do not count."""


def kinds_of(records: Sequence[FlightRecord]) -> np.ndarray:
    """Kind of each flight, 0 .. n-1 in the order in which they first appear, shape (flights,).

    Flights are of one kind when place, extent, speed, turning and thrust are alike; what their files are
    called plays no part.
    """
    if len(records) < 2:
        return np.zeros(len(records), dtype=int)
    flown = np.array([_flown(record) for record in records])
    difference = np.abs(flown[:, None] - flown[None]).max(axis=2)
    clusters = fcluster(linkage(squareform(difference, checks=False), "average"), _ALIKE, "distance")
    first = {cluster: number for number, cluster in enumerate(dict.fromkeys(clusters.tolist()))}
    return np.array([first[cluster] for cluster in clusters.tolist()])


def _flown(record: FlightRecord) -> FloatArray:
    """Logarithms of the ranges flown, and the middle of the flight in units of :data:`_APART`."""
    rows = record.flying if record.flying.any() else slice(None)
    position, velocity, rate = record.position[rows], record.velocity[rows], record.rate[rows]
    along = np.column_stack([position, velocity, rate, record.duty[rows].mean(axis=1)])
    low, middle, high = np.nanquantile(along, [0.05, 0.5, 0.95], axis=0)
    return np.concatenate([np.log(high - low + _FLOORS), middle[:3] / _APART])
