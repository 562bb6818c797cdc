"""What a campaign has flown, in SQLite: one row per try, committed before and after each flight.

States of a row: ``planned`` -> ``running`` -> ``done``, or ``interrupted`` when the process died or the
operator interrupted during the flight. An interrupted try keeps its row and its record, and a new try of the
same slot is planned. Two unique indexes hold what a campaign promises: a slot has at most one done row and at
most one open one.
"""

import json
import sqlite3
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar, Generic, Protocol, Self, TypeVar

from onboard.errors import PerchhwError
from onboard.outcome import Outcome
from onboard.record.folder import discard_if_empty, utc_now
from onboard.record.run_record import RunFolderError, is_run_folder, read_info
from perchhw.campaign.database import (
    DATABASE,
    CampaignError,
    columns_of,
    connected,
    decoded,
    mapping,
    numbers,
    understood,
)
from perchhw.flight.explain import explain

_SCHEMA = """
CREATE TABLE facts (key TEXT PRIMARY KEY, value TEXT NOT NULL);
CREATE TABLE attempts (
    id INTEGER PRIMARY KEY,
    slot INTEGER NOT NULL,
    {planned},
    try INTEGER NOT NULL,
    state TEXT NOT NULL CHECK (state IN ('planned', 'running', 'done', 'interrupted')),
    outcome TEXT,
    triggered INTEGER,
    trigger TEXT,
    aborted_by TEXT,
    record TEXT,
    started_utc TEXT,
    ended_utc TEXT,
    UNIQUE (slot, try)
);
CREATE UNIQUE INDEX one_done ON attempts (slot) WHERE state = 'done';
CREATE UNIQUE INDEX one_open ON attempts (slot) WHERE state IN ('planned', 'running');
"""
_KEPT_SINCE = ("policy_crc32", "vehicle_sha256")
"""What is kept of a plan now and was not once: a campaign without it is older, and not asked for it."""


@dataclass(frozen=True, kw_only=True)
class Try:
    """One try of one slot, which its kind of campaign says more of; fields as in the table ``attempts``."""

    id: int
    slot: int
    try_number: int
    state: str
    outcome: str | None
    triggered: bool | None
    trigger: dict[str, Any] | None
    aborted_by: str | None
    record: Path | None
    started_utc: str | None
    ended_utc: str | None


Row = TypeVar("Row", bound=Try)
_Shaped = TypeVar("_Shaped")


class StoredPlan(Protocol):
    """What a store keeps of a campaign file."""

    @property
    def name(self) -> str:
        """The campaign's name."""

    def fixed_part(self) -> dict[str, Any]:
        """What must not change when the campaign is resumed."""


class TryStore(Generic[Row]):
    """The rows of one campaign folder. Every method that changes something has committed when it returns.

    Attributes:
        PLANNED: columns that say what is flown in a slot, with their types.
        ENDS: outcomes of a flight that came to its end.
        WHAT: it is a campaign of these.
    """

    PLANNED: ClassVar[Mapping[str, str]]
    ENDS: ClassVar[Sequence[str]]
    WHAT: ClassVar[str]

    def __init__(self, folder: Path, connection: sqlite3.Connection) -> None:
        self.folder = folder
        self._connection = connection

    @classmethod
    def _created(
        cls, folder: Path, plan: StoredPlan, facts: Mapping[str, Any], slots: Iterable[Sequence[Any]]
    ) -> Self:
        """Start a campaign.

        Args:
            folder: of the campaign.
            plan: what is to be flown.
            facts: what else is kept of it, by key, as JSON.
            slots: number and :attr:`PLANNED` of each.

        Raises:
            CampaignError: the folder already holds a campaign.
        """
        if columns_of(folder):
            raise CampaignError(
                f"{folder} already holds a campaign: continue it with --resume, or give another --out"
            )
        folder.mkdir(parents=True, exist_ok=True)
        store = cls(folder, connected(folder / DATABASE))
        planned = ",\n    ".join(f"{name} {kind} NOT NULL" for name, kind in cls.PLANNED.items())
        with (
            store._connection
        ):  # one transaction: a killed process leaves an empty database or a complete one
            store._connection.execute("BEGIN IMMEDIATE")
            for statement in _SCHEMA.format(planned=planned).split(";\n"):
                store._connection.execute(statement)
            rows = {"plan": _plan_text(plan), "name": plan.name}
            rows |= {key: json.dumps(value) for key, value in facts.items()}
            store._connection.executemany("INSERT INTO facts VALUES (?, ?)", list(rows.items()))
            for slot in slots:
                store._plan(slot)
        return store

    @classmethod
    def open(cls, folder: Path) -> Self:
        """Open an existing campaign.

        Raises:
            CampaignError: the folder holds none, or one of another kind.
        """
        columns = columns_of(folder)
        if not columns:
            raise CampaignError(f"{folder} holds no campaign (no {DATABASE}): give the folder of a campaign")
        if not columns >= set(cls.PLANNED):
            raise CampaignError(f"{folder} holds no campaign of {cls.WHAT}: give another folder")
        return cls(folder, connected(folder / DATABASE))

    @classmethod
    def resumed(cls, folder: Path, plan: StoredPlan, retry_aborted: bool) -> Self:
        """Open a campaign that goes on as `plan` says, with what a killed process left running settled.

        An attempt whose record was closed with an outcome, and not aborted, had ended: it is done. Any other
        one is interrupted, explained in its record, which the killed process could not do, and planned
        again.

        Args:
            folder: of the campaign.
            plan: its plan.
            retry_aborted: plan a new try of every slot whose flight was aborted.

        Raises:
            CampaignError: the folder holds no such campaign, or the plan is not the one it was started with;
                names the keys.
        """
        store = cls.open(folder)
        try:
            store._check_plan(plan)
            killed = [row.record for row in store.rows() if row.state == "running" and row.record is not None]
            store.recover()
            for record in killed:
                if is_run_folder(record):
                    explain(record)
            if retry_aborted:
                for row in store.rows():
                    if row.state == "done" and row.outcome == Outcome.ABORTED:
                        store._interrupt(row)
        except PerchhwError:
            store.close()
            raise
        return store

    @classmethod
    def exists(cls, folder: Path) -> bool:
        """Whether `folder` holds a campaign of this kind that was completely created."""
        return columns_of(folder) >= {"slot", *cls.PLANNED}

    def close(self) -> None:
        """Close the database."""
        self._connection.close()

    @property
    def name(self) -> str:
        """The campaign's name."""
        return str(self._fact("name"))

    def _fact(self, key: str, default: str = "") -> str:
        row = self._connection.execute("SELECT value FROM facts WHERE key = ?", (key,)).fetchone()
        return default if row is None else str(row[0])

    def _json_fact(self, key: str, shaped: Callable[[Any], _Shaped], default: str = "") -> _Shaped:
        return decoded(self.folder, self._fact(key, default), f"fact {key}", shaped)

    def _check_plan(self, plan: StoredPlan) -> None:
        ours, theirs = self._json_fact("plan", mapping), json.loads(_plan_text(plan))
        theirs = {key: value for key, value in theirs.items() if key in ours or key not in _KEPT_SINCE}
        changed = sorted(key for key in ours.keys() | theirs.keys() if ours.get(key) != theirs.get(key))
        if changed:
            raise CampaignError(
                f"{self.folder}: the campaign file, or what it names, changed since the start in "
                f"{', '.join(changed)}: undo that, or start a new campaign in another folder"
            )

    def rows(self) -> list[Row]:
        """All rows, in flying order, tries of a slot one after another."""
        cursor = self._connection.execute("SELECT * FROM attempts ORDER BY slot, try")
        return [self._row(r) for r in cursor.fetchall()]

    def next_planned(self) -> Row | None:
        """The first planned row in flying order, or None when all is done."""
        query = "SELECT * FROM attempts WHERE state = 'planned' ORDER BY slot LIMIT 1"
        found = self._connection.execute(query).fetchone()
        return None if found is None else self._row(found)

    def start(self, row: Row, record: Path) -> None:
        """The flight of `row` begins; its record will be the folder `record`."""
        self._change(
            "UPDATE attempts SET state = 'running', record = ?, started_utc = ? "
            "WHERE id = ? AND state = 'planned'",
            (str(record.relative_to(self.folder)), utc_now().isoformat(), row.id),
        )

    def finish(
        self,
        row: Row,
        outcome: str,
        aborted_by: str | None,
        triggered: bool | None = None,
        trigger: Mapping[str, Any] | None = None,
    ) -> None:
        """The flight of `row` ended so."""
        told = None if trigger is None else json.dumps(trigger)
        self._change(
            "UPDATE attempts SET state = 'done', outcome = ?, triggered = ?, trigger = ?, aborted_by = ?, "
            "ended_utc = ? WHERE id = ? AND state = 'running'",
            (str(outcome), triggered, told, aborted_by, utc_now().isoformat(), row.id),
        )

    @contextmanager
    def settled(self, record: Path) -> Iterator[None]:
        """Whatever ends a flight early (Ctrl-C, a bug): its record says whether it is planned again."""
        try:
            yield
        except BaseException:
            self.recover()
            discard_if_empty(record)
            raise

    def recover(self) -> None:
        """Settle what is running no more, by the records."""
        for row in self.rows():
            if row.state != "running" or row.record is None:
                continue
            ended = self._end_of(row.record)
            if ended is not None:
                self.finish(row, ended["outcome"], None, bool(ended.get("triggered")), ended.get("trigger"))
            else:
                self._give_back(row, row.record)

    def _end_of(self, record: Path) -> dict[str, Any] | None:
        """What a record says of its flight, if that had ended by itself; None otherwise."""
        try:
            info = read_info(record) if is_run_folder(record) else None
        except RunFolderError:
            return None
        ended = info is not None and info["closed"] and info.get("aborted_by") is None
        return info if ended and info is not None and info.get("outcome") in self.ENDS else None

    def _give_back(self, row: Row, record: Path) -> None:
        """The flight of `row` was ended from outside: plan it again, as a new try if it left a record."""
        discard_if_empty(record)
        if record.exists():
            self._interrupt(row)
            return
        self._change(
            "UPDATE attempts SET state = 'planned', record = NULL, started_utc = NULL "
            "WHERE id = ? AND state = 'running'",
            (row.id,),
        )

    def _interrupt(self, row: Row) -> None:
        """The flight of `row` did not end by itself: keep it, and plan a new try of its slot."""
        planned = ", ".join(self.PLANNED)
        with self._connection:
            self._connection.execute("BEGIN IMMEDIATE")
            self._connection.execute(
                "UPDATE attempts SET state = 'interrupted', ended_utc = coalesce(ended_utc, ?) WHERE id = ?",
                (utc_now().isoformat(), row.id),
            )
            self._connection.execute(
                f"INSERT INTO attempts (slot, {planned}, try, state) "
                f"SELECT slot, {planned}, try + 1, 'planned' FROM attempts WHERE id = ?",
                (row.id,),
            )

    def _plan(self, slot: Sequence[Any]) -> None:
        """Plan the first try of a slot: its number and :attr:`PLANNED`."""
        columns = ("slot", *self.PLANNED)
        self._connection.execute(
            f"INSERT INTO attempts ({', '.join(columns)}, try, state) "
            f"VALUES ({', '.join('?' for _ in columns)}, 1, 'planned')",
            slot,
        )

    def _change(self, statement: str, values: Sequence[Any]) -> None:
        with self._connection:
            changed = self._connection.execute(statement, values).rowcount
        if changed != 1:
            raise CampaignError(f"{self.folder}: attempt changed by another process")

    def _row(self, values: sqlite3.Row) -> Row:
        raise NotImplementedError

    def _tried(self, values: sqlite3.Row) -> dict[str, Any]:
        """What all kinds of rows have."""
        attempt = f"of attempt {values['slot'] + 1}"
        return {
            "id": values["id"],
            "slot": values["slot"],
            "try_number": values["try"],
            "state": values["state"],
            "outcome": None
            if values["outcome"] is None
            else understood(self.folder, values["outcome"], f"outcome {attempt}", self._known_outcome),
            "triggered": None if values["triggered"] is None else bool(values["triggered"]),
            "trigger": None
            if values["trigger"] is None
            else decoded(self.folder, values["trigger"], f"trigger {attempt}", numbers),
            "aborted_by": values["aborted_by"],
            "record": None if values["record"] is None else self.folder / values["record"],
            "started_utc": values["started_utc"],
            "ended_utc": values["ended_utc"],
        }

    def _known_outcome(self, said: str) -> str:
        if said not in (*self.ENDS, Outcome.ABORTED):
            raise ValueError(said)
        return said


def _plan_text(plan: StoredPlan) -> str:
    return json.dumps(plan.fixed_part(), sort_keys=True)
