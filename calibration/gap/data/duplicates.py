"""Copies of one flight under several names: by the numbers, not by the file."""

import hashlib
from collections.abc import Sequence

import numpy as np
from scipy.fft import next_fast_len

from calibration.flights.flight import Flight
from onboard.arrays import FloatArray

_TIME_S = 1e-4
_PLACES = 5

_ALIKE, _OVERLAP = 0.98, 0.5
"""Correlation of two gyros' differences that makes one flight of two; least overlap, share of the shorter."""

_SHOCK = 3.0
"""Of the median difference that is not zero: what is larger is a shock. With shocks different landings reach
0.99, without them 0.93 (tests/truth/landings, seeds 307 and 502), the authors' 0.44."""


def content_hash(flight: Flight) -> str:
    """Hash of pose and gyro over the time since the start; the same for a renamed or recompressed copy."""
    digest = hashlib.sha256()
    digest.update(np.round((flight.t - flight.t[0]) / _TIME_S).astype(np.int64).tobytes())
    for name in ("x", "y", "z", "gx", "gy", "gz"):
        if name in flight.data:
            values = np.where(flight.valid[name], flight.data[name], 0.0)
            digest.update(name.encode())
            digest.update((np.round(values, _PLACES) + 0.0).tobytes())  # + 0.0 turns -0 into 0
    return digest.hexdigest()


def duplicate_of(flights: Sequence[Flight]) -> tuple[Flight | None, ...]:
    """For each flight the earlier one that it copies, or None.

    A copy may be cut, shifted or rounded: its gyro shakes as the other's does, which no two flights' do.
    """
    shaken = [_shaken(flight) for flight in flights]
    found: list[Flight | None] = []
    for index in range(len(flights)):
        earlier = (i for i in range(index) if found[i] is None and _same(shaken[i], shaken[index]))
        found.append(next((flights[i] for i in earlier), None))
    return tuple(found)


def _shaken(flight: Flight) -> FloatArray:
    """Differences of the gyro, shape (3, n), of unit size; without shocks, which two landings share."""
    if not flight.has("gx", "gy", "gz"):
        return np.zeros((3, 0))
    steps = np.diff(flight.series("gx", "gy", "gz")[1], axis=0).T
    moved = np.abs(steps[steps != 0.0])
    if moved.size:
        usual = _SHOCK * float(np.median(moved))
        steps = np.clip(steps, -usual, usual)
    size = float(np.linalg.norm(steps))
    return steps / size if size > 0.0 else np.zeros((3, 0))


def _same(one: FloatArray, other: FloatArray) -> bool:
    """Whether one is the other, or a piece of it, at some shift."""
    if not one.size or not other.size:
        return False
    length = next_fast_len(one.shape[1] + other.shape[1], real=True)
    product = np.fft.rfft(one, length) * np.conj(np.fft.rfft(other, length))
    together = np.fft.irfft(product.sum(axis=0), length)
    shift = int(np.argmax(together))
    shift -= length if shift >= one.shape[1] else 0
    first, end = max(shift, 0), min(one.shape[1], other.shape[1] + shift)
    a, b = one[:, first:end], other[:, first - shift : end - shift]
    both = float(np.linalg.norm(a) * np.linalg.norm(b))
    enough = end - first >= _OVERLAP * min(one.shape[1], other.shape[1])
    return bool(enough and np.sum(a * b) > _ALIKE * both)
