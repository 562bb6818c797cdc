"""The store of a campaign of landings: what its grid asked for, and a row per try of each attempt."""

import sqlite3
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, ClassVar

from perchhw.attempt import Outcome
from perchhw.campaign.database import mapping, understood
from perchhw.campaign.plan import CampaignPlan, Condition, Misfit, Slot
from perchhw.campaign.tries import Try, TryStore


@dataclass(frozen=True, kw_only=True)
class AttemptRow(Try):
    """One try of one landing attempt."""

    speed: float
    angle_deg: float
    repeat: int
    outcome: Outcome | None

    @property
    def place(self) -> Slot:
        """The planned attempt that this is a try of."""
        return Slot(self.slot, self.speed, self.angle_deg, self.repeat)


class CampaignStore(TryStore[AttemptRow]):
    """The rows of one campaign of landings."""

    PLANNED: ClassVar = {"speed_m_s": "REAL", "angle_deg": "REAL", "repeat": "INTEGER"}
    ENDS = tuple(Outcome)
    WHAT = "landings"

    @classmethod
    def create(cls, folder: Path, plan: CampaignPlan) -> "CampaignStore":
        """Start a campaign: all slots planned.

        Raises:
            CampaignError: the folder already holds a campaign.
        """
        facts = {
            "planned": plan.most_attempts,
            "conditions": plan.conditions(),
            "skipped": [asdict(misfit) for misfit in plan.skipped],
        }
        return cls._created(folder, plan, facts, map(_values, plan.slots()))

    @property
    def planned(self) -> int:
        """How many attempts the campaign has at most."""
        return int(self._json_fact("planned", int, "0")) or len({row.slot for row in self.rows()})

    @property
    def conditions(self) -> list[Condition]:
        """The conditions of its grid; none where it was started before they were kept."""
        return self._json_fact("conditions", _conditions, "[]")

    @property
    def skipped(self) -> list[Misfit]:
        """What of the grid was left out at the start, and why."""
        return self._json_fact("skipped", lambda said: [Misfit(**mapping(one)) for one in said], "[]")

    def plan_next(self, slot: Slot) -> AttemptRow:
        """Plan one more attempt than were planned at the start."""
        with self._connection:
            self._plan(_values(slot))
        return next(row for row in self.rows() if row.slot == slot.number)

    def _row(self, values: sqlite3.Row) -> AttemptRow:
        tried = self._tried(values)
        tried["outcome"] = None if tried["outcome"] is None else Outcome(tried["outcome"])
        speed, angle = (
            understood(self.folder, values[key], f"{key} of attempt {tried['slot'] + 1}", float)
            for key in ("speed_m_s", "angle_deg")
        )
        return AttemptRow(**tried, speed=speed, angle_deg=angle, repeat=values["repeat"])


def _conditions(said: Any) -> list[Condition]:
    return [(float(speed), float(angle)) for speed, angle in said]


def _values(slot: Slot) -> tuple[int, float, float, int]:
    return slot.number, slot.speed, slot.angle_deg, slot.repeat
