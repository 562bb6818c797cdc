"""Which flights are fitted to, which are kept back, and which are fitted together in cross-validation."""

from collections.abc import Sequence

import numpy as np

from calibration.gap.data.record import FlightRecord
from onboard.arrays import FloatArray

FEW = 4.0
"""Flights: what fewer than these show cannot be checked on flights of other shapes."""

_KEPT_BACK = 0.3
"""Share of the flights that no fit sees."""

_FOLDS = 5
_LOST = 0.85
"""A flight is not kept back when the others would reach less than this share of a range of excitation."""

_REACHING = 2
"""Flights that reach as far: what one flight alone shows is not believed."""


def split_flights(records: Sequence[FlightRecord]) -> tuple[list[int], list[int]]:
    """Indices of the flights to fit to, and of those to keep back.

    Whole shapes of trajectories are kept back first, so that what is found must hold on flights of another
    kind, then single flights of shapes flown several times; but nothing that alone, or as one of two, shows
    an excitation (the fastest, the highest, the lowest flight ...), because an effect that it reveals could
    not be found.
    A single flight is fitted to and nothing is kept back.
    """
    reach = np.array([_excitation(record) for record in records])
    wanted = int(_KEPT_BACK * len(records))
    kept: list[int] = []
    for group in _groups(records):
        rest = [i for i in range(len(records)) if i not in kept and i not in group]
        if len(kept) + len(group) <= wanted and rest and _covers(reach[rest], reach):
            kept.extend(group)
    return [i for i in range(len(records)) if i not in kept], sorted(kept)


def folds(records: Sequence[FlightRecord]) -> np.ndarray:
    """Fold of each flight for cross-validation: flights of one shape together, folds of like size."""
    shapes = sorted({record.shape for record in records})
    if len(shapes) < 2:
        return np.arange(len(records)) % _FOLDS
    sizes = np.zeros(min(_FOLDS, len(shapes)))
    fold_of = {}
    for shape in sorted(shapes, key=lambda s: -sum(r.shape == s for r in records)):
        fold_of[shape] = int(np.argmin(sizes))
        sizes[fold_of[shape]] += sum(record.shape == shape for record in records)
    return np.array([fold_of[record.shape] for record in records])


def _groups(records: Sequence[FlightRecord]) -> list[list[int]]:
    """Whole shapes, the rarest first, then the last flight of each shape flown twice or more."""
    shapes: dict[str, list[int]] = {}
    for index, record in enumerate(records):
        shapes.setdefault(record.shape, []).append(index)
    whole = sorted(shapes.values(), key=len)
    several = [[group[-1]] for group in shapes.values() if len(group) > 1]
    return [*whole, *several] if len(shapes) > 1 else [[i] for i in range(len(records) - 1, 0, -1)]


def _excitation(record: FlightRecord) -> FloatArray:
    """Ranges of what a flight excites: speeds, heights, thrust, turning, each as low and high quantile."""
    rows = record.flying
    if not rows.any():
        return np.zeros(14)
    mean_duty = record.duty[rows].mean(axis=1)
    values = np.column_stack(
        [
            np.linalg.norm(record.velocity[rows, :2], axis=1),
            record.velocity[rows, 2],
            record.position[rows, 2],
            mean_duty,
            np.ptp(record.duty[rows], axis=1),
            record.rate[rows, 2],
            np.linalg.norm(record.rate[rows, :2], axis=1),
        ]
    )
    return np.concatenate([np.quantile(values, 0.01, axis=0), np.quantile(values, 0.99, axis=0)])


def _covers(part: FloatArray, whole: FloatArray) -> bool:
    """Whether some flights reach nearly as far as all of them, in every quantity, and two of them if more do.

    Quantities are low quantiles, then high ones, of shape (flights, 14).
    """
    low, high = whole.min(axis=0), whole.max(axis=0)
    extent = np.maximum(high - low, 1e-9)
    half = whole.shape[1] // 2

    def reaching(flights: FloatArray) -> np.ndarray:
        lowest, highest = (
            (high - flights)[:, :half] / extent[:half],
            (flights - low)[:, half:] / extent[half:],
        )
        return np.asarray((np.hstack([lowest, highest]) >= _LOST).sum(axis=0))

    return bool(np.all(reaching(part) >= np.minimum(reaching(whole), _REACHING)))
