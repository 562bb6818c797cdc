"""What kind of thing ended attempts early, and how many of each kind a campaign bears."""

import re
from collections import Counter
from collections.abc import Mapping
from enum import StrEnum
from typing import Final

from mocap_bridge.errors import MocapError
from onboard.errors import PerchhwError
from onboard.link.errors import LinkError


class AbortKind(StrEnum):
    """What an aborted attempt failed by."""

    LINK = "link"
    MOCAP = "mocap"
    BATTERY = "battery"
    DRONE = "drone"
    PATH = "path"
    OTHER = "other"


_RULES: Final[tuple[tuple[AbortKind, str], ...]] = (
    (AbortKind.LINK, r"link|estimate_age|rates_age|drone_state_age|no answer"),
    (
        AbortKind.MOCAP,
        r"pose|estimate_to_mocap|heading_to_mocap|drone_broke_off: pose|mocap|descent_disagreement",
    ),
    (AbortKind.BATTERY, r"battery"),
    (AbortKind.DRONE, r"drone_|parameters|policy|the drone|stopped by|somebody|stop_unconfirmed|disarming"),
    (
        AbortKind.PATH,
        r"corridor|fence|inside_room|tilt|speed|rotation|flip|flight_time|descent|height|start_mark|"
        r"no steady hover|the (start|approach|course)",
    ),
)
"""Beginnings of a reason, by kind; the first that matches holds."""


def abort_kind(reason: str, error: PerchhwError | None = None) -> AbortKind:
    """The kind of an aborted attempt.

    Args:
        reason: rule and what it found, as the record says it; of several the first.
        error: the error that ended it, if one did.
    """
    if isinstance(error, LinkError):
        return AbortKind.LINK
    if isinstance(error, MocapError):
        return AbortKind.MOCAP
    return next((kind for kind, words in _RULES if re.match(words, reason)), AbortKind.OTHER)


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
