"""The flights of one shift held against the world's own record, and against what was done to them.

Wrong is: a record that is lost or cannot be read, a flight of the world that no record tells of, an attempt
that counts twice, motors that turn after a flight has ended, a reason that was not given cause for, a label
that is not what the world saw, and an error of ours.
"""

import json
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from calibration.flights.table import load_table
from onboard.arrays import FloatArray
from onboard.errors import PerchhwError
from onboard.record.run_record import RunRecord, is_run_folder
from perchhw.attempt import Outcome
from perchhw.campaign.store import AttemptRow
from perchhw.diagnosis import Cause
from perchhw.diagnosis.busy import SLOWEST
from tests.faulty_campaign.fly import ATTEMPTS
from tests.faulty_campaign.shift import CAUSES, Blow

LOST, TWICE, MOTORS = "lost", "counted twice", "motors on"
REASON, LABEL, ERROR = "wrong reason", "wrong label", "error of ours"
WATCHDOG_S = 1.1
"""After the last that a killed flight has written: 1 s from its last kick, which may come a little later."""
SAMPLE_S = 0.02
_UNTIL_S = 1.0
"""How long after the end of a flight its motors are watched."""
_AIRBORNE_M = 0.25
_FEET = {
    (True, False): (Outcome.FOUR_LEG,),
    (True, True): (Outcome.FOUR_LEG_BODY_CONTACT,),
    (False, False): (Outcome.TWO_LEG,),
    (False, True): (Outcome.TWO_LEG_BODY_CONTACT,),
}


@dataclass(frozen=True)
class Wrong:
    """One thing that is not as it must be: what kind of thing, where, and in words."""

    what: str
    record: str
    words: str


@dataclass(frozen=True)
class Judged:
    """What was judged in a shift, and what of it was wrong; of `late` flights, in a lab that fell behind real
    time on a busy computer (docs/lab_time.md), only that their records are there and whole.
    """

    aborts: int
    reasons: int
    labels: int
    flights: int
    wrong: tuple[Wrong, ...]
    late: int = 0


@dataclass(frozen=True)
class World:
    """The lab's own record: times (n,) s, height (n,) m, largest motor command (n,), feet (n,) that hold,
    whether the body touched (n,)."""

    t: FloatArray
    z: FloatArray
    motors: FloatArray
    feet: FloatArray
    body: FloatArray

    @classmethod
    def read(cls, truth: Path) -> "World":
        """From the file of ``sim lab --truth --truth-motors``; a lab that is killed may tear its last row."""
        whole = truth.read_text().rpartition("\n")[0] if truth.exists() else ""
        if whole.count("\n") < 2:
            return cls(*np.zeros((5, 0)))
        truth.write_text(whole + "\n")
        table = load_table(truth)
        columns = ("z", "motor_max", "legs_attached", "body_contact")
        return cls(table.t, *(table.data[name] for name in columns))

    def lasts_until(self, t: float) -> bool:
        """Whether the lab lived then."""
        return self.t.size > 0 and t <= self.t[-1] + SAMPLE_S

    def watched(self, still: float, following: float, lived: bool) -> NDArray[np.bool_]:
        """Rows (n,) in which motors must not turn: from the last one before `still` (s) on, for a second, or
        until the next flight begins. Time stands still when nothing moves, so where the lab `lived` it may be
        the very last row.
        """
        until = min(following, still + _UNTIL_S)
        rows = (self.t > still - SAMPLE_S) & (self.t < until)
        if lived and not rows.any() and following == np.inf and self.t.size:
            rows[-1] = True
        return rows

    def take_offs(self) -> list[float]:
        """When motors began to turn for a flight that left the floor, s."""
        on = np.flatnonzero(np.diff(np.concatenate([[0], (self.motors > 0.0).astype(int), [0]])))
        spans = zip(on[::2], on[1::2], strict=True)
        return [float(self.t[a]) for a, b in spans if self.z[a:b].max() > _AIRBORNE_M > self.z[a]]

    def outcomes(self, begin: float, end: float, triggered: bool) -> tuple[Outcome, ...]:
        """How a flight in this time ended; it may have been put on its mark only after it began."""
        first, last = np.searchsorted(self.t, [begin, end + SAMPLE_S])
        part = slice(first + int(np.argmax(self.motors[first:last] > 0.0)), last)
        z, feet = self.z[part], int(self.feet[part][-1])
        if feet == 0:
            return (Outcome.FAILURE,) if triggered else (Outcome.NO_TRIGGER,)
        near = z > 0.5 * z.max()
        return _FEET[feet >= 3, bool(self.body[part][near].any())]


def judge(shift: Path, campaign: Path, rows: Sequence[AttemptRow]) -> Judged:
    """The flights of the shift that is kept in the folder `shift`, with all `rows` of the campaign."""
    said = json.loads((shift / "shift.json").read_text())
    flown = [name for name in said.get("records", []) if name not in said["before"]]
    by_name = {row.record.name: row for row in rows if row.record is not None}
    wrong = [Wrong(LOST, name, "no row of the campaign names it") for name in flown
             if name not in by_name and (campaign / ATTEMPTS / name).exists()]  # fmt: skip
    wrong += _wrong_end(said, shift / "said.txt")
    tries = [by_name[name] for name in flown if name in by_name]
    records = []
    for row in tries:
        record, problem = _record(row, said)
        wrong += problem
        records += [] if record is None else [(row, record)]
    world, offset = World.read(shift / "truth.csv"), float(said.get("clock_offset", 0.0))
    lived = "exit_code" in said and all(blow["blow"] != Blow.LAB_KILLED for blow in said["struck"])
    begins = [float(record.info["clock_at_start"]) - offset for _, record in records]
    aborts = reasons = labels = late = 0
    for (row, record), begin, following in zip(records, begins, [*begins[1:], np.inf], strict=False):
        wrong += _internal(record) + _torn(record, said)
        if said.get("at_real_pace") and _fell_behind(record):
            late += 1
            continue
        aborted = row.state != "done" or row.outcome is Outcome.ABORTED
        reasons += aborted
        wrong += _wrong_reason(row, record, said) if aborted else []
        end = _end(record, offset)
        if end is not None and not aborted and world.lasts_until(end):
            labels += 1
            seen = world.outcomes(begin, end, bool(row.triggered))
            if row.outcome not in seen:
                wrong.append(Wrong(LABEL, record.folder.name, f"{row.outcome}, the world saw {seen}"))
        still = end if end is not None else _last(record, offset) + WATCHDOG_S
        watched = world.watched(still, following, lived)
        if still > float(said["faults"].get("freeze_drone_at", np.inf)):
            continue  # its motors keep their command, whatever anybody does
        aborts += aborted and bool(watched.any())
        if (world.motors[watched] > 0.0).any():
            t = world.t[watched][world.motors[watched] > 0.0][0]
            wrong.append(Wrong(MOTORS, record.folder.name, f"at {t:.2f} s, it ended at {still:.2f} s"))
    flights = world.take_offs()
    wrong += _untold(flights, records, begins, shift.name)
    return Judged(aborts, reasons, labels, len(flights), tuple(wrong), late)


def counted(rows: Sequence[AttemptRow], campaign: Path, slots: int) -> list[Wrong]:
    """What is lost or counted twice in the campaign as a whole."""
    done = Counter(row.slot for row in rows if row.state == "done")
    wrong = [Wrong(TWICE, f"slot {slot}", f"{n} times") for slot, n in done.items() if n > 1]
    wrong += [Wrong(LOST, f"slot {slot}", "never flown") for slot in set(range(slots)) - done.keys()]
    records = [row.record for row in rows if row.record is not None]
    wrong += [Wrong(TWICE, r.name, "two rows name it") for r, n in Counter(records).items() if n > 1]
    wrong += [Wrong(LOST, r.name, "it is gone") for r in records if not r.is_dir()]
    named = {record.name for record in records}
    there = (path.name for path in (campaign / ATTEMPTS).iterdir())
    return wrong + [Wrong(LOST, name, "no row names it") for name in there if name not in named]


def _record(row: AttemptRow, said: dict[str, Any]) -> tuple[RunRecord | None, list[Wrong]]:
    """Its record; None where the flight had not begun one, which only what was done to it excuses."""
    assert row.record is not None
    if not is_run_folder(row.record):
        excused = said["struck"] or said["faults"] or said["file_limit"] is not None
        told = row.state == "interrupted" or row.aborted_by
        lost = Wrong(LOST, row.record.name, f"{row.state} without a record: {row.aborted_by}")
        return None, [] if excused and told else [lost]
    try:
        return RunRecord.read(row.record), []
    except PerchhwError as error:
        return None, [Wrong(LOST, row.record.name, str(error))]


def _wrong_end(said: dict[str, Any], file: Path) -> list[Wrong]:
    """Of the run, whose words are in `file`: it hung, failed, or ended as no run may."""
    name, wrong = f"shift {said['number']}", []
    words = file.read_text() if file.exists() else ""
    if "Traceback" in words:
        wrong.append(Wrong(ERROR, name, words[words.index("Traceback") :]))
    if said.get("hung"):
        wrong.append(Wrong(ERROR, name, "the run did not end"))
    may = {0, 3}
    struck = {blow["blow"] for blow in said["struck"]}
    may |= {-9} if Blow.KILLED in struck else set()
    may |= {130} if Blow.INTERRUPTED in struck else set()
    may |= {2} if said["file_limit"] is not None else set()
    if "exit_code" in said and not said["hung"] and said["exit_code"] not in may:
        wrong.append(Wrong(ERROR, name, f"exit code {said['exit_code']}: {words[-500:]}"))
    return wrong


def _internal(record: RunRecord) -> list[Wrong]:
    name = record.folder.name
    found = [event for event in record.events if event["event"] == "internal_error"]
    return [Wrong(ERROR, name, str(event["error"])) for event in found]


def _torn(record: RunRecord, said: dict[str, Any]) -> list[Wrong]:
    """What was on the disk when a process was struck must still be there."""
    now = (record.folder / "events.jsonl").read_text()
    left = [blow["left"] for blow in said["struck"] if blow["record"] == record.folder.name]
    whole = all(now.startswith(text.rpartition("\n")[0]) for text in left)
    return [] if whole else [Wrong(LOST, record.folder.name, "events that were on the disk are not there")]


def _wrong_reason(row: AttemptRow, record: RunRecord, said: dict[str, Any]) -> list[Wrong]:
    """A reason that neither a fault of the lab nor a blow to this flight gave cause for."""
    name = record.folder.name
    given = {Cause(text) for text in said["causes"]}
    if "exit_code" not in said:  # the shift was cut off: whoever flew it was killed, and the lab with him
        given |= {cause for blow in (Blow.KILLED, Blow.LAB_KILLED) for cause in CAUSES[blow]}
    for blow in said["struck"]:
        lasting = Blow(blow["blow"]) in (Blow.LAB_KILLED, Blow.ROOM_KILLED)
        if blow["record"] == name or lasting:
            given |= set(CAUSES[Blow(blow["blow"])])
    if Cause.PROCESS_KILLED in given and any(event.get("phase") == "done" for event in record.events):
        given.add(Cause.FLOWN)  # killed between the end of its flight and its label
    told = record.info.get("diagnosis")
    if told is None:
        return [Wrong(REASON, name, "none is told")]
    if Cause(told["code"]) in given:
        return []
    words = f"{told['code']} ({told['sentence']}; {row.aborted_by}), not {sorted(given)}"
    return [Wrong(REASON, name, words)]


def _fell_behind(record: RunRecord) -> bool:
    rate = record.info.get("drone_clock_rate")
    return rate is not None and float(rate) < SLOWEST


def _end(record: RunRecord, offset: float) -> float | None:
    end = record.info.get("clock_at_end")
    return None if end is None else float(end) - offset


def _last(record: RunRecord, offset: float) -> float:
    """The last that it has written: an event, or a row of a series."""
    begin = float(record.info["clock_at_start"])
    rows = [float(series.t[-1]) for series in record.series.values()]
    return max([begin, *rows, *(float(event["t"]) for event in record.events)]) - offset


def _untold(
    flights: Sequence[float],
    records: Sequence[tuple[AttemptRow, RunRecord]],
    begins: Sequence[float],
    shift: str,
) -> list[Wrong]:
    """Flights of the world that no record tells of."""
    wrong = []
    for t in flights:
        before = [i for i, begin in enumerate(begins) if begin <= t + 0.5]
        phases = {event.get("phase") for event in records[before[-1]][1].events} if before else set()
        if not phases & {"arming", "taking off"}:
            wrong.append(Wrong(LOST, shift, f"it flew at {t:.1f} s, and no record tells of it"))
    return wrong
