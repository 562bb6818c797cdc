"""Copies of one flight under several names: by a hash of the numbers, not of the file."""

import hashlib
from collections.abc import Sequence

import numpy as np

from calibration.flights.flight import Flight

_TIME_S = 1e-4
_PLACES = 5


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
    """For each flight the earlier one that it copies, or None."""
    seen: dict[str, Flight] = {}
    found: list[Flight | None] = []
    for flight in flights:
        digest = content_hash(flight)
        found.append(seen.get(digest))
        seen.setdefault(digest, flight)
    return tuple(found)
