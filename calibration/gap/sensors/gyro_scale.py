"""Whether a gyro shows as much as the tracked body turns.

Held against each other are what the gyro says of each half second and by how much the tracked attitude turned
in it, after delay, turn of the frame and bias are taken out. A model of the vehicle would take a gyro that
shows too much for inertias that are too small.
"""

import itertools
from collections.abc import Iterator, Sequence

import numpy as np
from scipy.spatial.transform import Rotation

from calibration.gap.data.record import FlightRecord
from onboard.arrays import FloatArray

_WINDOW_S = 0.5

_LEAST = 0.02
"""Share: what is smaller passes for what sensors are sold as."""

_CERTAIN = 6.0
"""Standard errors; jackknifed over pieces of flights, of which there are enough to take them as known."""

_PIECE = 10
"""Windows of one flight that are left out together: 5 s."""

_FEWEST = 8
"""Pieces."""

_LEAST_TURN = 0.05
"""rad, standard deviation over a piece's windows of what is turned about an axis: slower ones tell nothing
that noise of the tracked attitude (a few mrad) does not hide."""


def gyro_scale(aligned: Sequence[FlightRecord]) -> tuple[str, ...]:
    """Sentences on the axes about which the gyro shows another angle than the tracked body turned by.

    Args:
        aligned: flights with delay, turn of the tracked frame and bias taken out, attitude as tracked.
    """
    pieces = [piece for record in aligned for piece in _pieces(record)]
    return tuple(_judged(pieces))


def _judged(pieces: Sequence[tuple[FloatArray, FloatArray]]) -> Iterator[str]:
    for axis, name in enumerate("xyz"):
        told = [(t[:, axis], s[:, axis]) for t, s in pieces if np.std(t[:, axis]) > _LEAST_TURN]
        if len(told) < _FEWEST:
            continue
        products = np.array([[np.cov(t, s, ddof=0)[0, 1], np.var(t)] for t, s in told])
        without = products.sum(axis=0) - products
        slopes = without[:, 0] / without[:, 1]
        more = float(products[:, 0].sum() / products[:, 1].sum()) - 1.0
        count = len(told)
        error = float(np.sqrt((count - 1) / count * ((slopes - slopes.mean()) ** 2).sum()))
        if abs(more) > max(_LEAST, _CERTAIN * error):
            word = "more" if more > 0.0 else "less"
            yield (
                f"the gyro shows {abs(more):.1%} +- {error:.1%} {word} about b_{name} than the tracked body "
                "turns: its scale is off, and inertias and whatever goes with rates may be off by as much"
            )


def _pieces(record: FlightRecord) -> Iterator[tuple[FloatArray, FloatArray]]:
    """Turns (rad, body axes) in the windows of each piece, tracked and as the gyro says: (k, 3) each."""
    size = max(round(_WINDOW_S / record.dt), 1)
    known = record.flying & record.pose_known & record.inertial_known
    starts = np.arange(0, record.t.size - size, size)
    starts = starts[[bool(known[first : first + size + 1].all()) for first in starts]]
    if starts.size < _PIECE:
        return
    at = Rotation.from_quat(record.attitude[starts])
    tracked = (at.inv() * Rotation.from_quat(record.attitude[starts + size])).as_rotvec()
    shown = Rotation.identity(starts.size)
    for step in range(size):
        middle = 0.5 * (record.rate[starts + step] + record.rate[starts + step + 1])
        shown = shown * Rotation.from_rotvec(middle * record.dt)
    said = shown.as_rotvec()
    cuts = np.linspace(0, starts.size, starts.size // _PIECE + 1).round().astype(int)
    for first, end in itertools.pairwise(cuts):
        yield tracked[first:end], said[first:end]
