"""Which flights are fitted to, which are kept back, and which are fitted together in cross-validation."""

from collections.abc import Sequence

import numpy as np

from calibration.gap.data.record import FlightRecord
from onboard.arrays import FloatArray

FEW = 3.2
"""Flights, counted as the equal ones that tell as much: what fewer show cannot be checked on others. Three
are few; four are not, though one of them may tell twice as much as another."""

_KEPT_BACK = 0.3
"""Share of the flights that no fit sees."""

_ENOUGH = 4
"""Flights of which one can be spared though each reaches somewhere that the others do not."""

_FOLDS = 5
_LOST = 0.85
"""A flight is not kept back when the others would reach less than this share of a range of excitation."""

_REACHING = 2
"""Flights that reach as far: what one flight alone shows is not believed."""


def split_flights(records: Sequence[FlightRecord]) -> tuple[list[int], list[int]]:
    """Indices of the flights to fit to, and of those to keep back.

    Whole kinds of flights are kept back first, so that what is found must hold on flights of another
    kind, then single flights of kinds flown several times; but nothing that alone, or as one of two, shows
    an excitation (the fastest, the highest, the lowest flight ...), because an effect that it reveals could
    not be found.
    Of few flights the most ordinary one is kept back; of fewer than four, none.
    """
    reach = np.array([_excitation(record) for record in records])
    wanted = int(_KEPT_BACK * len(records))
    kept: list[int] = []
    for group in _groups(records):
        if not set(group).isdisjoint(kept):
            continue
        rest = [i for i in range(len(records)) if i not in kept and i not in group]
        if len(kept) + len(group) <= wanted and rest and _covers(reach[rest], reach):
            kept.extend(group)
    if not kept and len(records) >= _ENOUGH:
        kept.append(_most_ordinary(reach))
    return [i for i in range(len(records)) if i not in kept], sorted(kept)


def folds(records: Sequence[FlightRecord]) -> np.ndarray:
    """Fold of each flight for cross-validation: flights of one kind together, folds of like size.

    A kind that most flights are of is spread over all folds: held out, it would leave nothing to learn from.
    """
    sizes = np.zeros(min(_FOLDS, len(records)))
    fold_of = np.zeros(len(records), dtype=int)
    for group in sorted(_kinds(records), key=lambda group: -len(group)):
        together = [group] if len(group) <= 0.5 * len(records) else [[i] for i in group]
        for flights in together:
            fold = int(np.argmin(sizes))
            fold_of[flights] = fold
            sizes[fold] += len(flights)
    return fold_of


def _kinds(records: Sequence[FlightRecord]) -> list[list[int]]:
    """Flights of each kind, in the order in which the kinds first appear."""
    kinds: dict[str, list[int]] = {}
    for index, record in enumerate(records):
        kinds.setdefault(record.shape, []).append(index)
    return list(kinds.values())


def _groups(records: Sequence[FlightRecord]) -> list[list[int]]:
    """Whole kinds, the rarest first, then the last flight of each kind flown twice or more."""
    kinds = _kinds(records)
    if len(kinds) == 1:
        return [[i] for i in range(len(records) - 1, 0, -1)]
    return [*sorted(kinds, key=len), *([group[-1]] for group in kinds if len(group) > 1)]


def _most_ordinary(reach: FloatArray) -> int:
    """The flight that is nearest to the middle of all, whose excitations have shape (flights, 14)."""
    extent = np.maximum(np.ptp(reach, axis=0), 1e-9)
    return int(np.argmin(np.abs((reach - np.median(reach, axis=0)) / extent).sum(axis=1)))


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
