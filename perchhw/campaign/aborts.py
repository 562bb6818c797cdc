"""How many aborted attempts of a kind, and in a row, a campaign bears."""

from collections import Counter
from collections.abc import Mapping

from perchhw.diagnosis.rules import AbortKind


class AbortCount:
    """The aborted attempts of one run of a campaign, held against its limits.

    Args:
        in_a_row: so many aborted attempts, one after another, end it.
        by_kind: so many of a kind in all end it; a kind that is not there is not limited.
    """

    def __init__(self, in_a_row: int, by_kind: Mapping[str, int]) -> None:
        self._limit, self._limits = in_a_row, by_kind
        self._in_a_row = 0
        self._kinds: Counter[AbortKind] = Counter()

    def ended(self, kind: AbortKind | None) -> str | None:
        """An attempt ended, None: not aborted; which limit that reaches, in words, or None."""
        if kind is None:
            self._in_a_row = 0
            return None
        self._in_a_row += 1
        self._kinds[kind] += 1
        if self._in_a_row >= self._limit:
            return f"{self._in_a_row} attempts in a row were aborted"
        limit = self._limits.get(kind)
        if limit is not None and self._kinds[kind] >= limit:
            return f"{self._kinds[kind]} attempts were aborted by the {kind} (stop.aborts.{kind} = {limit})"
        return None
