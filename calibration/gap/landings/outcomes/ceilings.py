"""Where the ceiling was: as far above where the drone reckoned it as the contacts of the same session say.

The vehicle's highest point at the moment of the contact is where the ceiling was. A flight gets the median of
the other flights of its session, so that its own end does not help to predict it. Where drones of a session
reckon with several heights, either their frames differ, and what a contact tells is how far the ceiling is
above the reckoned one; or somebody corrected a number, and the room is the same. Contacts scatter less in the
right one of the two.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from calibration.gap.landings.outcomes.starts import TriggerStart
from onboard.arrays import FloatArray, IntArray

LEAST_CEILING = 3
"""Contacts of other flights that tell a ceiling."""

_ONE_ROOM = 0.2  # m between what drones reckon; beyond, the error of one room says nothing of the other's


@dataclass(frozen=True)
class UnknownCeiling:
    """A ceiling of too few contacts: its flights are simulated with the one that their drone reckoned.

    Attributes:
        session: of the flights. contacts: in that room. flights: how many have no other ceiling.
    """

    session: str
    contacts: int
    flights: int

    @property
    def words(self) -> str:
        """A sentence for people."""
        contacts = "1 contact" if self.contacts == 1 else f"{self.contacts} contacts"
        flights = "1 flight" if self.flights == 1 else f"{self.flights} flights"
        return (
            f"ceiling of {self.session or 'these flights'}: {contacts}, too few to know it (it takes "
            f"{LEAST_CEILING + 1}): as the drone reckoned, in {flights}"
        )


def session_ceilings(starts: Sequence[TriggerStart], implied: FloatArray) -> tuple[FloatArray, IntArray]:
    """Ceiling (m, (n,)) of each flight, and contacts (n,) of other flights of its room.

    Where these are fewer than LEAST_CEILING, the ceiling is the one that the drone reckoned.

    Args:
        implied: m (n,), ceiling by each flight's own contact; NaN where unseen.
    """
    sessions = np.array([start.flight.session for start in starts])
    reckoned = np.array([start.reckoned_ceiling for start in starts])
    heights, contacts = reckoned.copy(), np.zeros(len(starts), dtype=np.int64)
    for index in range(len(starts)):
        near = (sessions == sessions[index]) & (np.abs(reckoned - reckoned[index]) < _ONE_ROOM)
        others = near & np.isfinite(implied)
        others[index] = False
        contacts[index] = np.count_nonzero(others)
        if contacts[index] >= LEAST_CEILING:
            heights[index] = _ceiling(implied[others], reckoned[others], reckoned[index])
    return heights, contacts


def _ceiling(implied: FloatArray, reckoned: FloatArray, own: float) -> float:
    """Ceiling (m) by contacts of other flights, of a flight whose drone reckoned with `own` (m)."""
    above = implied - reckoned
    if _scatter(above) <= _scatter(implied):
        return own + float(np.median(above))
    return float(np.median(implied))


def _scatter(values: FloatArray) -> float:
    return float(np.median(np.abs(values - np.median(values))))


def unknown_ceilings(
    starts: Sequence[TriggerStart], implied: FloatArray, contacts: IntArray
) -> tuple[UnknownCeiling, ...]:
    """Of which sessions the ceiling is not known; arguments and contacts as of :func:`session_ceilings`."""
    unknown: dict[tuple[str, int], int] = {}
    for start, own, others in zip(starts, np.isfinite(implied), contacts, strict=True):
        if others < LEAST_CEILING:
            room = start.flight.session, int(others + own)
            unknown[room] = unknown.get(room, 0) + 1
    return tuple(UnknownCeiling(*room, flights) for room, flights in unknown.items())
