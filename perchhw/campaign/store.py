"""A campaign's results in SQLite: one row per try, committed before and after each attempt.

States of a row: ``planned`` -> ``running`` -> ``done``, or ``interrupted`` when the process died or the
operator interrupted during the attempt. An interrupted try keeps its row and its record, and a new try of the
same slot is planned. Two unique indexes hold what a campaign promises: a slot has at most one done row and at
most one open one.
"""

import json
import sqlite3
from collections.abc import Sequence
from contextlib import closing
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from calibration.flights.run_folder import RunFolderError, is_run_folder, read_info
from onboard.errors import InputError
from perchhw.attempt import AttemptResult, Outcome
from perchhw.campaign.plan import CampaignPlan, Condition, Misfit, Slot
from perchhw.errors import FlightStackError
from perchhw.record.folder import discard_if_empty, utc_now

DATABASE = "campaign.db"

_SCHEMA = """
CREATE TABLE facts (key TEXT PRIMARY KEY, value TEXT NOT NULL);
CREATE TABLE attempts (
    id INTEGER PRIMARY KEY,
    slot INTEGER NOT NULL,
    speed_m_s REAL NOT NULL,
    angle_deg REAL NOT NULL,
    repeat INTEGER NOT NULL,
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

_PLAN_ATTEMPT = (
    "INSERT INTO attempts (slot, speed_m_s, angle_deg, repeat, try, state) VALUES (?, ?, ?, ?, ?, 'planned')"
)


class CampaignError(FlightStackError, InputError):
    """A campaign folder cannot be used as asked; the message says what to do."""


@dataclass(frozen=True)
class AttemptRow:
    """One row of the store (one try of one slot); fields as in the table ``attempts``."""

    id: int
    slot: int
    speed: float
    angle_deg: float
    repeat: int
    try_number: int
    state: str
    outcome: Outcome | None
    triggered: bool | None
    trigger: dict[str, Any] | None
    aborted_by: str | None
    record: Path | None
    started_utc: str | None
    ended_utc: str | None

    @property
    def place(self) -> Slot:
        """The planned attempt that this is a try of."""
        return Slot(self.slot, self.speed, self.angle_deg, self.repeat)


class CampaignStore:
    """The rows of one campaign folder. Every method that changes something has committed when it returns."""

    def __init__(self, folder: Path, connection: sqlite3.Connection) -> None:
        self.folder = folder
        self._connection = connection

    @classmethod
    def create(cls, folder: Path, plan: CampaignPlan) -> "CampaignStore":
        """Start a campaign: all slots planned.

        Raises:
            CampaignError: the folder already holds a campaign.
        """
        if exists(folder):
            raise CampaignError(
                f"{folder} already holds a campaign: continue it with --resume, or give another --out"
            )
        folder.mkdir(parents=True, exist_ok=True)
        store = cls(folder, _connect(folder / DATABASE))
        with (
            store._connection
        ):  # one transaction: a killed process leaves an empty database or a complete one
            store._connection.execute("BEGIN IMMEDIATE")
            for statement in _SCHEMA.split(";\n"):
                store._connection.execute(statement)
            facts = {
                "plan": _plan_text(plan),
                "name": plan.name,
                "planned": json.dumps(plan.most_attempts),
                "conditions": json.dumps(plan.conditions()),
                "skipped": json.dumps([asdict(misfit) for misfit in plan.skipped]),
            }
            store._connection.executemany("INSERT INTO facts VALUES (?, ?)", list(facts.items()))
            store._connection.executemany(
                _PLAN_ATTEMPT, [(s.number, s.speed, s.angle_deg, s.repeat, 1) for s in plan.slots()]
            )
        return store

    @classmethod
    def open(cls, folder: Path) -> "CampaignStore":
        """Open an existing campaign.

        Raises:
            CampaignError: the folder holds none.
        """
        if not exists(folder):
            raise CampaignError(f"{folder} holds no campaign (no {DATABASE}): give the folder of a campaign")
        return cls(folder, _connect(folder / DATABASE))

    def close(self) -> None:
        """Close the database."""
        self._connection.close()

    @property
    def name(self) -> str:
        """The campaign's name."""
        return str(self._fact("name"))

    @property
    def planned(self) -> int:
        """How many attempts the campaign has at most."""
        return int(json.loads(self._fact("planned", default="0"))) or len({row.slot for row in self.rows()})

    @property
    def conditions(self) -> list[Condition]:
        """The conditions of its grid; none where it was started before they were kept."""
        return [(speed, angle) for speed, angle in json.loads(self._fact("conditions", default="[]"))]

    @property
    def skipped(self) -> list[Misfit]:
        """What of the grid was left out at the start, and why."""
        return [Misfit(**values) for values in json.loads(self._fact("skipped", default="[]"))]

    def _fact(self, key: str, default: str = "") -> str:
        row = self._connection.execute("SELECT value FROM facts WHERE key = ?", (key,)).fetchone()
        return default if row is None else str(row[0])

    def check_plan(self, plan: CampaignPlan) -> None:
        """Check that `plan` is the one the campaign was started with.

        Raises:
            CampaignError: it differs in more than URIs and stop rule; names the keys.
        """
        ours, theirs = json.loads(self._fact("plan")), json.loads(_plan_text(plan))
        changed = sorted(key for key in ours.keys() | theirs.keys() if ours.get(key) != theirs.get(key))
        if changed:
            raise CampaignError(
                f"{self.folder}: the campaign file changed since the start in {', '.join(changed)}: "
                "undo that, or start a new campaign in another folder"
            )

    def rows(self) -> list[AttemptRow]:
        """All rows, in flying order, tries of a slot one after another."""
        cursor = self._connection.execute("SELECT * FROM attempts ORDER BY slot, try")
        return [self._row(r) for r in cursor.fetchall()]

    def next_planned(self) -> AttemptRow | None:
        """The first planned row in flying order, or None when all is done."""
        query = "SELECT * FROM attempts WHERE state = 'planned' ORDER BY slot LIMIT 1"
        found = self._connection.execute(query).fetchone()
        return None if found is None else self._row(found)

    def plan_next(self, slot: Slot) -> AttemptRow:
        """Plan one more attempt than were planned at the start."""
        with self._connection:
            values = (slot.number, slot.speed, slot.angle_deg, slot.repeat, 1)
            self._connection.execute(_PLAN_ATTEMPT, values)
        return next(row for row in self.rows() if row.slot == slot.number)

    def start(self, row: AttemptRow, record: Path) -> None:
        """The attempt of `row` begins; its record will be the folder `record`."""
        self._change(
            "UPDATE attempts SET state = 'running', record = ?, started_utc = ? "
            "WHERE id = ? AND state = 'planned'",
            (str(record.relative_to(self.folder)), utc_now().isoformat(), row.id),
        )

    def finish(self, row: AttemptRow, result: AttemptResult) -> None:
        """The attempt of `row` ended with `result`."""
        trigger = None if result.trigger is None else json.dumps(result.trigger)
        values = (
            result.outcome.value,
            result.triggered,
            trigger,
            result.aborted_by,
            utc_now().isoformat(),
            row.id,
        )
        self._change(
            "UPDATE attempts SET state = 'done', outcome = ?, triggered = ?, trigger = ?, aborted_by = ?, "
            "ended_utc = ? WHERE id = ? AND state = 'running'",
            values,
        )

    def interrupt(self, row: AttemptRow) -> None:
        """The attempt of `row` did not end by itself: keep it, and plan a new try of its slot."""
        with self._connection:
            self._connection.execute("BEGIN IMMEDIATE")
            self._connection.execute(
                "UPDATE attempts SET state = 'interrupted', ended_utc = coalesce(ended_utc, ?) WHERE id = ?",
                (utc_now().isoformat(), row.id),
            )
            self._connection.execute(
                _PLAN_ATTEMPT,
                (row.slot, row.speed, row.angle_deg, row.repeat, row.try_number + 1),
            )

    def give_back(self, row: AttemptRow, record: Path) -> None:
        """The attempt of `row` was ended from outside: plan it again, as a new try if it left a record."""
        discard_if_empty(record)
        if record.exists():
            self.interrupt(row)
            return
        self._change(
            "UPDATE attempts SET state = 'planned', record = NULL, started_utc = NULL "
            "WHERE id = ? AND state = 'running'",
            (row.id,),
        )

    def plan_aborted_again(self) -> None:
        """Plan a new try of every slot whose attempt was aborted; the aborted try counts as interrupted."""
        for row in self.rows():
            if row.state == "done" and row.outcome is Outcome.ABORTED:
                self.interrupt(row)

    def recover(self) -> None:
        """Settle what a killed process left running.

        An attempt whose record was closed with an outcome, and not aborted, had ended: it is done. Any other
        one is interrupted and planned again.
        """
        for row in self.rows():
            if row.state != "running":
                continue
            result = _result_of_record(row)
            if result is not None:
                self.finish(row, result)
            elif row.record is not None:
                self.give_back(row, row.record)

    def _change(self, statement: str, values: Sequence[Any]) -> None:
        with self._connection:
            changed = self._connection.execute(statement, values).rowcount
        if changed != 1:
            raise CampaignError(f"{self.folder}: attempt changed by another process")

    def _row(self, values: sqlite3.Row) -> AttemptRow:
        return AttemptRow(
            id=values["id"],
            slot=values["slot"],
            speed=values["speed_m_s"],
            angle_deg=values["angle_deg"],
            repeat=values["repeat"],
            try_number=values["try"],
            state=values["state"],
            outcome=None if values["outcome"] is None else Outcome(values["outcome"]),
            triggered=None if values["triggered"] is None else bool(values["triggered"]),
            trigger=None if values["trigger"] is None else json.loads(values["trigger"]),
            aborted_by=values["aborted_by"],
            record=None if values["record"] is None else self.folder / values["record"],
            started_utc=values["started_utc"],
            ended_utc=values["ended_utc"],
        )


def exists(folder: Path) -> bool:
    """Whether `folder` holds a campaign that was completely created."""
    path = folder / DATABASE
    if not path.is_file():
        return False
    with closing(_connect(path)) as connection:
        query = "SELECT count(*) FROM sqlite_master WHERE name = 'attempts'"
        return bool(connection.execute(query).fetchone()[0])


def _connect(path: Path) -> sqlite3.Connection:
    """Open the database.

    Raises:
        CampaignError: it is damaged.
    """
    connection = sqlite3.connect(path, isolation_level=None, timeout=5.0)
    connection.row_factory = sqlite3.Row
    try:
        connection.execute("PRAGMA journal_mode = WAL")
        connection.execute("PRAGMA synchronous = FULL")
        (found,) = connection.execute("PRAGMA quick_check(1)").fetchone()
    except sqlite3.OperationalError:  # locked, say: nothing is wrong with the file
        connection.close()
        raise
    except sqlite3.DatabaseError as error:
        found = str(error)
    if found != "ok":
        connection.close()
        raise CampaignError(
            f"{path}: is damaged ({found}): restore it; the records beside it can be read without "
            f"(perchhw log list {path.parent / 'attempts'})"
        )
    return connection


def _plan_text(plan: CampaignPlan) -> str:
    return json.dumps(plan.fixed_part(), sort_keys=True)


def _result_of_record(row: AttemptRow) -> AttemptResult | None:
    """What the record of a running row says, if the attempt had ended; None otherwise."""
    if row.record is None or not is_run_folder(row.record):
        return None
    try:
        info = read_info(row.record)
    except RunFolderError:
        return None
    ended = info["closed"] and info.get("outcome") in tuple(Outcome) and info.get("aborted_by") is None
    if not ended:
        return None
    return AttemptResult(
        outcome=Outcome(info["outcome"]),
        triggered=bool(info.get("triggered")),
        trigger=info.get("trigger"),
        aborted_by=None,
        record=row.record,
    )
